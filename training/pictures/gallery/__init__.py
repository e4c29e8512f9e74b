"""Recorded pushes as one page that plays them: chosen, played again, drawn without a server."""
