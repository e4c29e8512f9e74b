"""Postures in which bodies of a robot are where they are asked to be."""
