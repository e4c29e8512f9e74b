"""Pictures and the window; they only read."""
