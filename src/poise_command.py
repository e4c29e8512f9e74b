"""The command `poise` from its first moment: a stop while Python still imports is one, too.

It stands outside the package, whose own import takes as long as a hand on Ctrl-C.
"""

from __future__ import annotations

import os
import signal
from types import FrameType


def command() -> None:
    """Run the command line; `poise.training.cli` answers stops from its `main` on."""
    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
            signal.signal(number, _leave)
    from poise.training.cli.entry import command

    command()


def _leave(number: int, frame: FrameType | None) -> None:
    """Nothing has been begun: there is nothing to unwind."""
    os.write(2, b"poise: stopped; the same command starts from the beginning\n")
    os._exit(128 + number)


if __name__ == "__main__":
    command()
