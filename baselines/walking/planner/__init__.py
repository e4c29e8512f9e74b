"""Steps of a walk: where, when, and whether legs reach."""
