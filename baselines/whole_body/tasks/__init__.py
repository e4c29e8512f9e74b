"""Tasks of the momentum QP: each a file with unit-free gains, its rows in NumPy, and its kernel."""
