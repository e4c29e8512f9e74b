"""From a description in YAML and MJCF to a `Robot`: constants that no simulation changes."""
