"""A motion from a line of script, by the cheapest way through a graph of clips."""
