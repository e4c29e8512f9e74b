"""Captured and synthesised motion: read, retargeted, joined, made feasible, performed."""
