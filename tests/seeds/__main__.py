"""`python -m tests.seeds [WORDS …]`: run the rows whose text has all of the words.

Prints what each figure is beside what it is to be. --write makes docs/seeds.md; --daily runs the
short form; --list only names the commands.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

from .page import PAGE, page_of
from .rows import load_documents
from .running import faults, prepare, run_alone, runs_of


def main() -> int:
    """Exit code 1 if a row does not hold."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("words", nargs="*")
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--daily", action="store_true")
    parser.add_argument("--list", action="store_true")
    asked = parser.parse_args()
    documents = load_documents()
    if asked.write:
        PAGE.write_text(page_of(documents))
        print(PAGE)
        return 0
    rows = [
        row
        for document in documents
        for row in document.rows
        if all(word in f"{row} {document.key}" for word in asked.words)
    ]
    wrong = 0
    with tempfile.TemporaryDirectory() as name:
        folder = prepare(Path(name))
        for run in runs_of(rows, daily=asked.daily):
            print(run.run, flush=True)
            if asked.list:
                continue
            begin = time.perf_counter()
            code, output = run_alone(run, folder)
            found = list(faults(run, code, output))
            wrong += bool(found)
            for figure in run.figures if code == run.exit else ():
                try:
                    print(f"    {figure.read(output):g} {figure.unit}, to be {figure.is_:g} ± "
                          f"{figure.within:g}")  # fmt: skip
                except ValueError:
                    print(f"    no {figure.reads!r}")
            print(f"    {time.perf_counter() - begin:.1f} s, exit code {code}", *found, flush=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    raise SystemExit(main())
