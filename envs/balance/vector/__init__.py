"""Many environments at once: how threads share their steps, and Gymnasium's form of it."""
