"""Motion matching: which frame of many clips continues best from here to the commanded pose."""
