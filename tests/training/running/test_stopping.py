"""training/running/stopping.py: Ctrl-C and SIGTERM; `tests.endurance.ctrl_c` tries all commands."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from poise.training.cli import entry
from poise.training.cli.entry import main
from poise.training.running.stopping import Stopped, stop_code, stoppable, uninterrupted
from tests.endurance.processes import Running, heed_interrupts, kill
from tests.support.evaluations import random_suite, write_suite
from tests.support.weekly import daily

# A native call of minutes that no signal interrupts, as a compilation is. It speaks from within the
# call: a signal before it would be heard.
DEAF = """
import hashlib, multiprocessing, threading, time
from poise.training.running.stopping import stoppable
if __name__ == "__main__":
    with stoppable():
        child = multiprocessing.get_context("fork").Process(target=time.sleep, args=(600,))
        child.start()
        threading.Timer(0.2, print, (child.pid,), {"flush": True}).start()
        hashlib.pbkdf2_hmac("sha256", b"", b"", 2**31 - 1)
"""
LATE = 20.0  # [s] for what takes one, on a machine that is busy with other tests


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_process_that_cannot_listen_is_ended(number: signal.Signals) -> None:
    """With its children, the line and the code of a stop."""
    process = subprocess.Popen(
        [sys.executable, "-c", DEAF], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        preexec_fn=heed_interrupts,
    )  # fmt: skip
    assert process.stdout is not None
    child = int(process.stdout.readline())
    process.send_signal(number)
    _, told = process.communicate(timeout=LATE)
    assert process.returncode == 128 + number
    assert told == "poise: stopped; the same command starts from the beginning\n"
    assert not kill(child, 0)


@pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="processes are found in /proc")
def test_a_stopped_evaluation_leaves_no_process_and_says_how_to_go_on(tmp_path: Path) -> None:
    """SIGTERM while two processes play: the finished trials stay, and the code is 143."""
    suite = write_suite(tmp_path, random_suite(5000))
    out = tmp_path / "out"
    running = Running(
        ["evaluate", "zero", "--suite", str(suite), "--out", str(out), "--workers", "2"]
    )
    log = out / "trials.jsonl"
    while not log.exists() or log.stat().st_size == 0:
        assert running.process.poll() is None, running.wait() or running.output
        time.sleep(0.05)
    kill(running.process.pid, signal.SIGTERM)
    assert running.wait(LATE) == 143 and running.left(0.0) == 0
    last = running.output.rstrip().splitlines()[-1]
    assert last == (
        f"poise: stopped; the finished trials are kept in {out}; the same command goes on"
    )
    assert "Traceback" not in running.output
    assert {path.name for path in out.iterdir()} == {"settings.yaml", "trials.jsonl"}


def test_signals_wait_while_processes_are_started(monkeypatch: pytest.MonkeyPatch) -> None:
    """They take effect once all processes are known; new ones never see Ctrl-C."""
    done = []
    with pytest.raises(Stopped, match="SIGTERM"), stoppable():
        with uninterrupted():
            os.kill(os.getpid(), signal.SIGTERM)
            assert signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, [])
            done.append("started")
        done.append("never")
    assert done == ["started"] and stop_code() == 143
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, [])


def test_handlers_are_put_back_and_ignored_signals_stay_ignored() -> None:
    """As in a background job of a shell, which Ctrl-C is not meant for."""
    before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    assert main(["list"]) == 0
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == before
    assert signal.set_wakeup_fd(-1) == -1
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with stoppable():
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.01)
    finally:
        signal.signal(signal.SIGINT, before[0])


def test_an_error_that_a_library_makes_of_a_stop_is_a_stop(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As an extension module does that is interrupted while it is imported."""

    def imports(_: object) -> int:
        try:
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(LATE)
        except KeyboardInterrupt:
            raise ImportError("initialization failed") from None
        return 0

    monkeypatch.setattr(entry, "_run", imports)
    assert main(["list"]) == 143
    assert capsys.readouterr().err == "poise: stopped; the same command starts from the beginning\n"
    monkeypatch.setattr(entry, "_run", lambda _: 0)
    assert main(["list"]) == 0 and stop_code() is None


# Whatever the package imports first brings the signal.
IMPORTING = """
import os, signal, sys
import poise_command
class Finder:
    def find_spec(self, name, path, target=None):
        os.kill(os.getpid(), {number})
sys.argv[1:] = ["list"]
sys.meta_path.insert(0, Finder())
poise_command.command()
"""
# The interpreter's end takes its time.
ENDING = """
import atexit, os, sys, time
import poise_command
from poise.training.cli.commands import COMMANDS
listed = COMMANDS["list"]
def command():
    listed()
    atexit.register(lambda: (os.kill(os.getpid(), {number}), time.sleep(600)))
COMMANDS["list"] = command
sys.argv[1:] = ["list"]
poise_command.command()
"""
# Python has taken its handlers away and drops the modules.
LAST = """
import os, sys
import poise_command
class Late:
    def __del__(self, kill=os.kill, process=os.getpid()):
        kill(process, {number})
late = Late()
sys.argv[1:] = ["list"]
poise_command.command()
"""
# The signal comes while processes are started, which takes longer than there is time to unwind.
STARTING = """
import os, time
from poise.training.running.stopping import GRACE, stoppable, uninterrupted
with stoppable(), uninterrupted():
    os.kill(os.getpid(), {number})
    time.sleep(1.4 * GRACE)
    print("started", flush=True)
"""


@pytest.mark.parametrize("number", daily([signal.SIGINT, signal.SIGTERM]))
@pytest.mark.parametrize(
    ("code", "exit_code", "out", "told"),
    [
        (IMPORTING, None, "", "poise: stopped; the same command starts from the beginning\n"),
        (ENDING, 0, "\nrobots ", ""),
        (LAST, 0, "\nrobots ", ""),
        (STARTING, None, "started\n", None),
    ],
    ids=["importing", "ending", "last", "starting"],
)
def test_a_stop_at_an_odd_moment(
    number: signal.Signals, code: str, exit_code: int | None, out: str, told: str | None
) -> None:
    """Before `main`, after it, and while processes are started: no traceback, and no waiting."""
    command = [sys.executable, "-P", "-c", code.format(number=int(number))]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=2 * LATE, preexec_fn=heed_interrupts
    )
    if told is not None:
        assert done.returncode == (128 + number if exit_code is None else exit_code), done.stderr
        assert done.stderr == told
    assert done.stdout.startswith(out)


LOST = """
import ctypes, os, time
from poise.training.running.stopping import stoppable
def lose(number):
    if not number:
        raise ValueError("told")
    os.kill(os.getpid(), number)
    time.sleep({late})
callback = ctypes.CFUNCTYPE(None, ctypes.c_int)(lose)
with stoppable():
    callback(0)
    print("still here", flush=True)
    callback({number})
    print("went on", flush=True)
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_stop_that_a_callback_loses_ends_the_process(number: signal.Signals) -> None:
    """As in one of LLVM's, which goes on without its code; what else is lost is told as ever."""
    command = [sys.executable, "-P", "-c", LOST.format(number=int(number), late=LATE)]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=2 * LATE, preexec_fn=heed_interrupts
    )
    assert done.returncode == 128 + number and done.stdout == "still here\n"
    assert "ValueError: told" in done.stderr and "Stopped" not in done.stderr
    assert done.stderr.endswith("poise: stopped; the same command starts from the beginning\n")
