"""Environments whose action moves the targets and steps of a controller."""
