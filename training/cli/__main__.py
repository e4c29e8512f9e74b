"""`python -m poise.training.cli`, where no script is installed."""

from .entry import command

command()
