"""Terrain as data: level ground, stairs, slopes and stepping stones, each kind in a file."""
