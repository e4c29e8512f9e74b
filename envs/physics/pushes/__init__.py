"""Pushes and kicks: what they are, how a caller writes them, how they are drawn."""
