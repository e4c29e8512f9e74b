"""Reference models of walking beside each other, and beside human data."""
