"""Limits of the momentum QP: each a file with gains, its rows in NumPy, and its kernel."""
