"""A motion from a line of script: its language, graphs of clips, the search, and the result."""
