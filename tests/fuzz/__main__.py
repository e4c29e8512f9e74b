"""`make fuzz`: cases of all kinds in turn, for a given time; exit code 1 if any is a fault."""

from __future__ import annotations

import argparse
import multiprocessing
import os
import secrets
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from .kinds import NAMES
from .runner import FOUND, Count, Runner, table

TURN = 10.0  # [s]


def main() -> int:
    """Parse, make what is to be broken, play, and say what came of it."""
    options = _options()
    print(f"seed {options.seed}, {options.minutes:g} minutes, kinds: {', '.join(options.kinds)}")
    with tempfile.TemporaryDirectory(prefix="poise-fuzz-") as folder:
        _make_samples(Path(folder))
        started = time.monotonic()
        end = started + 60.0 * options.minutes
        with ThreadPoolExecutor(options.workers) as threads:
            runners = list(threads.map(lambda k: _run(options, k, end), range(options.workers)))
    return _report(runners, time.monotonic() - started)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--seed", type=int, default=secrets.randbelow(10**6))
    parser.add_argument("--kinds", nargs="+", choices=NAMES, default=NAMES)
    parser.add_argument("--found", type=Path, default=FOUND, help="where faults are kept")
    return parser.parse_args()


def _make_samples(folder: Path) -> None:
    """In a process of their own; others find them by an environment variable."""
    from . import samples

    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    os.environ.setdefault("MPLBACKEND", "Agg")
    context = multiprocessing.get_context("spawn")
    maker = context.Process(target=samples.make_samples, args=(folder,))
    maker.start()
    maker.join()
    if maker.exitcode:
        raise SystemExit("the samples could not be made")
    os.environ[samples.PLACE] = str(folder)


def _run(options: argparse.Namespace, worker: int, end: float) -> Runner:
    """All kinds in turn; workers have seeds of their own and begin with different kinds."""
    runner = Runner(options.seed * options.workers + worker, options.found)
    shift = worker * len(options.kinds) // options.workers
    kinds = [*options.kinds[shift:], *options.kinds[:shift]]
    try:
        while time.monotonic() < end:
            for kind in kinds:
                runner.turn(kind, min(TURN, max(end - time.monotonic(), 0.1)))
            cases = sum(count.cases for count in runner.counts.values())
            left = max(end - time.monotonic(), 0.0) / 60.0
            print(f"{cases} cases, {len(runner.faults)} faults, {left:.1f} min left", flush=True)
    finally:
        runner.close()
    return runner


def _report(runners: list[Runner], seconds: float) -> int:
    counts: dict[str, Count] = {}
    for runner in runners:
        for name, count in runner.counts.items():
            counts.setdefault(name, Count()).join(count)
    faults = {what: entry for runner in runners for what, entry in runner.faults.items()}
    print(table(counts))
    cases = sum(count.cases for count in counts.values())
    print(f"{cases} cases in {seconds / 60.0:.1f} minutes, {len(faults)} different faults")
    for what, (_, _, outcome) in sorted(faults.items()):
        print(f"{outcome.verdict}: {what}")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
