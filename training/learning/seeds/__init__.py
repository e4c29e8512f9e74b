"""Several seeds of one training."""
