"""Reference models of the stance leg: what the height of a walk follows."""
