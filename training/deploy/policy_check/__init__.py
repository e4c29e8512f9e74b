"""Checks of an external policy before it is evaluated: what is missing, what is wrong."""
