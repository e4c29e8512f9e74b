"""`python -m poise`: the command `poise`, where no script is on the path."""

from poise_command import command

command()
