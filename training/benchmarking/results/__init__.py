"""Finished folders of either kind, read back, compared and played again."""
