"""One trial: who plays it, what pushes are measured by, what became of it."""
