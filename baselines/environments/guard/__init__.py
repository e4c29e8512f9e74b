"""A recovery policy as a guard, which takes over from a walker that is about to fall."""
