"""Motions and gaits played as measurements: followed, tracked, compared."""
