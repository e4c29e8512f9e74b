"""Sensors: the state that a controller may know, and when."""
