"""Motion matching: which frame of many clips goes on best from here to where one wants to be."""
