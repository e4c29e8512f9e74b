"""The HTML report of a finished folder."""
