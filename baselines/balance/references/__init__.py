"""Reference motions, and the targets that they give at a tick."""
