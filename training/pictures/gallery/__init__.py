"""Recorded pushes as one page that plays them without a server."""
