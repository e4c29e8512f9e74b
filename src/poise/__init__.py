"""Poise keeps a simulated humanoid on its feet while it is pushed."""

__version__ = "0.1.0"
