"""The commands of `poise motion`."""
