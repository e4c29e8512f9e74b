"""The command `poise`: what its subcommands take, and what they call."""

from .entry import command, main

__all__ = ["command", "main"]
