"""Figures, the report's pages, and the viewer."""
