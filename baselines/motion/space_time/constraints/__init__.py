"""A user's constraints on a motion, in addition to the clip."""
