"""Controllers that step: when, where to, and how a foot gets there."""
