"""A robot before anything is tried on it: what it can hold, and what will go wrong."""
