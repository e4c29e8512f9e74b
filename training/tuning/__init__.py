"""Gains by CMA-ES."""
