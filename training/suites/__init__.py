"""Which trials an evaluation is made of."""
