"""Controllers that keep their feet where they are."""
