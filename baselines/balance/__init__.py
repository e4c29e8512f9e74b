"""Balance: in place, on reference motions, with steps."""
