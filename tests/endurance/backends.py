"""Every back end, 1, 2 and 3 processes: `python -m tests.endurance.backends`.

The bar: trials.csv of `poise benchmark` has the same bytes from all. `poise evaluate` runs on the
processes of this machine alone, in the same three numbers. Ray is left out where it is missing.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib.util
import sys
import tempfile
from pathlib import Path

from .commands import Command, commands
from .processes import Running

BACKENDS = ("local", "joblib", "ray")


def main(arguments: list[str] | None = None) -> int:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--seed", type=int, default=2)
    options.add_argument("--only", nargs="*", default=["evaluate", "benchmark"])
    options.add_argument("--counts", nargs="*", type=int, default=[1, 2, 3])
    given = options.parse_args(arguments)
    missed = 0
    with tempfile.TemporaryDirectory(prefix="poise-backends-") as folder:
        room = Path(folder)
        chosen = {command.name: command for command in commands(room)}
        for name in given.only:
            missed += _compare(chosen[name], room / name, given.seed, given.counts)
    return 1 if missed else 0


def _compare(command: Command, room: Path, seed: int, counts: list[int]) -> bool:
    """Print the digest of each; whether they differ."""
    digests = set()
    for backend in BACKENDS if command.name == "benchmark" else BACKENDS[:1]:
        if backend == "ray" and importlib.util.find_spec("ray") is None:
            print(f"{command.name}, ray: skipped, it is not installed")
            continue
        for count in counts:
            out = room / f"{backend}-{count}"
            line = [*command.line(out), "--workers", str(count), "--seed", str(seed)]
            line += ["--backend", backend] if command.name == "benchmark" else []
            running = Running(line)
            assert running.wait() == 0, running.output
            digest = hashlib.sha256((out / "trials.csv").read_bytes()).hexdigest()[:16]
            digests.add(digest)
            print(f"{command.name}, {backend}, {count} processes: {digest}", flush=True)
    return len(digests) > 1


if __name__ == "__main__":
    sys.exit(main())
