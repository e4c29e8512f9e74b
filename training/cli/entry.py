"""The process of the command `poise`: exit codes, stops, and closed pipes."""

import atexit
import contextlib
import errno
import os
import select
import sys
from collections.abc import Sequence
from typing import TextIO

import tyro

import poise
from poise.baselines.extras import load_extra
from poise.configs.errors import ConfigError, PoiseError, meant, shown
from poise.configs.problems import Problem
from poise.training.running.options.arguments import check_flags, check_out
from poise.training.running.options.pages import print_commands
from poise.training.running.options.parsing import answered
from poise.training.running.options.spelling import respelled, suggestion
from poise.training.running.stopping import (
    exit_at_once,
    ignore_stops,
    stop_code,
    stop_message,
    stoppable,
)
from poise.training.running.terminal import speak_plainly, terminal

from .commands import COMMANDS
from .policies import run_policies

SHELLS = ("bash", "zsh", "fish")  # for which tyro writes completions
HELP = ("-h", "--help", "--help-all")
ALONE = ("--help", "--version", "--print-completion")  # options without a command
USAGE = """usage: poise COMMAND [OPTIONS]

Keep a simulated humanoid on its feet while it is pushed. To begin: poise demo.
poise COMMAND --help lists the options of a command.
"""
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)  # of a disk


def main(args: Sequence[str] | None = None) -> int:
    """Run a sub-command; return 0, 1 (a fall, an error, a no), 2 after bad input or on a full
    disk, 130 after Ctrl-C, 143 after SIGTERM, 141 if the output pipe was closed."""
    args = list(sys.argv[1:] if args is None else args)
    # Small matrices lose time to threads, and sums may change their order. Read at import.
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    speak_plainly()
    try:
        try:
            return _stoppable(args)
        except PoiseError as error:
            print_error(error)
            return 2
        finally:
            if sys.stdout is not None:  # poise list >&-
                sys.stdout.flush()
    except BrokenPipeError:
        unread = [stream for stream in (sys.stdout, sys.stderr) if _unread(stream)]
        if not unread:
            raise
        with open(os.devnull, "w") as nowhere:  # the exit flushes once more
            for stream in unread:
                os.dup2(nowhere.fileno(), stream.fileno())
        return 141


def print_error(error: PoiseError) -> None:
    """Print an error as the one line that it is."""
    print(f"poise: {error}", file=sys.stderr)


def _stoppable(args: list[str]) -> int:
    try:
        with stoppable():
            return _run(args)
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt) or stop_code() is not None:
            # a library may have made another error of the interrupt
            print(stop_message(), file=sys.stderr)
            return stop_code() or 130
        if isinstance(error, OSError) and error.errno in FULL:
            place = "" if error.filename is None else f"{error.filename}: "
            raise PoiseError(f"{place}cannot be written ({error.strerror})") from None
        if isinstance(error, FileNotFoundError) and "temporary directory" in str(error):
            raise PoiseError("no folder takes temporary files: set TMPDIR to one") from None
        mujoco_full = type(error).__name__ == "FatalError" and "allocate memory" in str(error)
        if isinstance(error, MemoryError) or mujoco_full:
            raise PoiseError("there is not enough memory: fewer workers, and in a training fewer "
                             "environments (--ppo.n-envs), take less") from None  # fmt: skip
        raise


def command() -> None:
    """`main` as a process: after a stop, or at one that comes when all is done, the interpreter
    takes no time for an end of its own."""
    atexit.register(ignore_stops)  # the first to be registered is the last to run
    code = main()
    if stop_code() is not None:
        sys.stderr.flush()
        os._exit(code)
    exit_at_once(code)
    sys.exit(code)


def _unread(stream: TextIO | None) -> bool:
    """Return True for a pipe whose reader has closed it."""
    try:
        poll = select.poll()
        poll.register(stream.fileno(), 0)  # type: ignore[union-attr]
    except (AttributeError, OSError, ValueError):  # no stream, no descriptor, no poll
        return False
    return bool(poll.poll(0))


def _run(args: list[str]) -> int:
    if args == ["--version"]:
        print(f"poise {poise.__version__}")
        return 0
    if args[:1] == ["--print-completion"]:
        return _complete(args[1:])
    if not args or args[0] in HELP:
        print_commands(USAGE, COMMANDS, terminal())
        return 0
    name, given = args[0], respelled(args[0], args[1:])
    if name.startswith("-"):
        raise Problem("unknown option", None, name, ALONE, hint=suggestion(name, ALONE))
    if name not in COMMANDS:
        hint = meant(name, COMMANDS)
        raise Problem("unknown command", None, None, COMMANDS, value=shown(name), hint=hint)
    check_out(given)
    if name == "train":  # its flags are the fields of a heavy dataclass
        check_flags(given, {"--config": "training", "--robot": "robots"})
        from .train import run_train

        run_train(given)
        return 0
    if name == "motion":  # it has sub-commands
        if {"--video", "--report"} & {word.partition("=")[0] for word in given}:
            from poise.envs.viewing.gl import choose_gl_backend

            choose_gl_backend()  # before the sub-commands import MuJoCo
        return int(load_extra("commands", name)(given))
    if name == "policies":  # it has one, too
        return run_policies(given)
    return answered(COMMANDS[name], given, f"poise {name}")


def _complete(given: list[str]) -> int:
    """Print the script by which a shell completes commands and options."""
    if len(given) != 1 or given[0] not in SHELLS:
        raise ConfigError("needs a shell", field="print-completion", choices=SHELLS)
    with contextlib.suppress(SystemExit):
        tyro.extras.subcommand_cli_from_dict(
            COMMANDS, prog="poise", args=["--tyro-print-completion", *given]
        )
    return 0
