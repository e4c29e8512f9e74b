"""Motions performed: how near a controller keeps a robot to its reference, pushed or not."""
