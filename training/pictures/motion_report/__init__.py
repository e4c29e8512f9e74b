"""Pictures of a graph, a script and a performed motion in one HTML file."""
