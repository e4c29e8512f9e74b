"""Finished results: read, compared, repeated, packed and published."""
