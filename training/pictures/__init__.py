"""What is looked at: figures, the report's pages, and the viewer."""
