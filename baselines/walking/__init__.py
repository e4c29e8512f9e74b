"""Controllers that walk."""
