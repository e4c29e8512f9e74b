"""Controllers that never stop stepping."""
