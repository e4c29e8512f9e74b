"""`python -m poise.training.cli`, where no script is installed."""

from .commands import command

command()
