"""Where and when to step, and the swing that does it."""
