"""Figures of a result, computed from trials and their outcomes."""
