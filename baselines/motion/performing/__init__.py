"""Motions whose feet leave the ground, performed on a schedule of contacts."""
