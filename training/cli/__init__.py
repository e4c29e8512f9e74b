"""The command `poise`: what its subcommands take, and what they call."""

from .commands import command, main

__all__ = ["command", "main"]
