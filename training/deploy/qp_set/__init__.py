"""QPs of real recoveries as files."""
