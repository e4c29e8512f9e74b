"""Evaluation of motions and gaits: followed, tracked, compared."""
