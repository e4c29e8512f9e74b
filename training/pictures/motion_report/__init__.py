"""What a graph, a script and a performed motion look like: one HTML file with pictures."""
