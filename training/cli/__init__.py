"""The command `poise`: what its subcommands take, and what they call."""

from .commands import main

__all__ = ["main"]
