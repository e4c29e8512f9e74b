"""One trial: its agent, the reference impulses of pushes, its outcome."""
