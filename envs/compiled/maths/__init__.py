"""Formulas without state: polygons, vectors and frames, the linear inverted pendulum."""
