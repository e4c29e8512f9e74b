"""Pictures of results by Matplotlib, and videos."""
