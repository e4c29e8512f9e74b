"""The suite as other processors would run it: `make test-processors`.

    python -m tests.processors [--repeat 3] [--only NAME] [--folder FOLDER] [PYTEST_ARGS]

What a processor decides is set apart: whom Numba compiles for, OpenBLAS's kernels, the SIMD of
NumPy and torch, whether the C library's sines are fused, threads, `fastmath`. Every setting has a
cache of compiled kernels of its own. MuJoCo's library cannot be set: it is one for all.
One line for each run with the tests that failed, whose output is in the folder; the exit code is 1
if any did. A setting that this machine cannot run is named and left out.
"""

from __future__ import annotations

import argparse
import os
import platform
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import llvmlite.binding
from numpy._core import _multiarray_umath as numpy_simd

ROOT = Path(__file__).resolve().parents[1]
CACHES = (
    Path(tempfile.gettempdir()) / f"poise-processors-{os.getuid()}"
)  # none in the working folder
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
AVX2 = ("avx2", "bmi2", "fma")
AVX512 = (*AVX2, "avx512bw", "avx512dq", "avx512f", "avx512vl")
NO_FMA = "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4"


def numpy_without(*parts: str) -> str:
    """NumPy's SIMD targets whose names hold one of `parts`, of those that would run here."""
    able = [name for name in numpy_simd.__cpu_dispatch__ if numpy_simd.__cpu_features__[name]]
    return " ".join(name for name in able if any(part in name for part in parts))


@dataclass(frozen=True)
class Setting:
    """A processor, whom Numba and OpenBLAS know by these names; None: the one that is there."""

    name: str
    numba: str | None = None
    openblas: str | None = None
    machine: str | None = None  # None: any
    needs: tuple[str, ...] = ()  # features, in LLVM's words
    threads: int = 1
    fastmath: bool = True
    others: tuple[tuple[str, str], ...] = ()  # further variables

    def problem(self) -> str | None:
        """Why this machine cannot run it, or None if it can."""
        if self.machine not in (None, platform.machine()):
            return f"for {self.machine}, this is {platform.machine()}"
        has = llvmlite.binding.get_host_cpu_features()
        lacking = [name for name in self.needs if not has.get(name)]
        return f"this processor has no {', '.join(lacking)}" if lacking else None

    def environment(self, cache: Path) -> dict[str, str]:
        """The variables of a process that takes itself for this processor."""
        chosen = dict.fromkeys(THREADS, str(self.threads)) | dict(self.others)
        chosen |= {"NUMBA_CACHE_DIR": str(cache), "POISE_FASTMATH": str(int(self.fastmath))}
        if self.numba:  # without features of its own, LLVM takes those of the name
            chosen |= {"NUMBA_CPU_NAME": self.numba, "NUMBA_CPU_FEATURES": ""}
        if self.openblas:
            chosen["OPENBLAS_CORETYPE"] = self.openblas
        return {**os.environ, **chosen}


OLD = (("NPY_DISABLE_CPU_FEATURES", numpy_without("AVX", "FMA", "X86_V3", "X86_V4")),
       ("ATEN_CPU_CAPABILITY", "default"), ("MKL_CBWR", "COMPATIBLE"),
       ("GLIBC_TUNABLES", NO_FMA))  # fmt: skip
WITHOUT_AVX512 = (("NPY_DISABLE_CPU_FEATURES", numpy_without("AVX512", "X86_V4")),
                  ("ATEN_CPU_CAPABILITY", "avx2"), ("MKL_CBWR", "AVX2"))  # fmt: skip

SETTINGS = (
    Setting("host"),
    Setting("host-2-threads", threads=2),
    Setting("host-strict", fastmath=False),
    Setting("generic", "generic", "Prescott", "x86_64", others=OLD),
    Setting("generic-strict", "generic", "Prescott", "x86_64", (), 2, False, OLD),
    Setting("haswell", "haswell", "Haswell", "x86_64", AVX2, others=WITHOUT_AVX512),
    Setting("skylake-avx512", "skylake-avx512", "SkylakeX", "x86_64", AVX512),
    Setting("znver3", "znver3", "Zen", "x86_64", AVX2, threads=2, others=WITHOUT_AVX512),
    Setting("armv8", "generic", "ARMV8", "aarch64"),
    Setting("neoverse-n1", "neoverse-n1", "NEOVERSEN1", "aarch64", ("dotprod", "lse")),
    Setting("apple-m1", "apple-m1", machine="arm64"),
)


def play(setting: Setting, folder: Path, number: int, pytest_args: list[str]) -> bool:
    """One run of the suite, with its line; whether every test passed."""
    log, begun = folder / f"{setting.name}-{number}.log", time.perf_counter()
    command = [sys.executable, "-m", "pytest", "-q", "-rfE", "-p", "no:cacheprovider", *pytest_args]
    with log.open("w") as out:
        done = subprocess.run(
            command, cwd=ROOT, stdout=out, stderr=subprocess.STDOUT, check=False,
            env=setting.environment(CACHES / setting.name),
        )  # fmt: skip
    lines = log.read_text().splitlines() or ["no output"]
    took = f"{time.perf_counter() - begun:.0f} s"
    print(
        f"{setting.name:<16} run {number}: {re.sub(r' in .*', '', lines[-1])}, {took}", flush=True
    )
    for line in _failures(lines):
        print(f"    {line}", flush=True)
    return done.returncode == 0


def _failures(lines: list[str]) -> Iterator[str]:
    """Names of failed tests, out of pytest's short summary."""
    for line in lines:
        if line.startswith(("FAILED ", "ERROR ")):
            yield line.split(" - ")[0]


def main(args: list[str] | None = None) -> int:
    """Run what was asked for; 0 if all passed."""
    parser = argparse.ArgumentParser(prog="python -m tests.processors", epilog="Other arguments "
                                     "are pytest's.")  # fmt: skip
    parser.add_argument("--repeat", type=int, default=1, help="runs of each setting")
    parser.add_argument("--workers", type=int, default=1, help="processes of each run")
    parser.add_argument("--folder", type=Path, default=ROOT / "build" / "processors")
    parser.add_argument("--only", action="append", metavar="NAME", help="one of %(choices)s",
                        choices=[setting.name for setting in SETTINGS])  # fmt: skip
    chosen, pytest_args = parser.parse_known_args(args)
    pytest_args += ["-n", str(chosen.workers)] if chosen.workers > 1 else []
    chosen.folder.mkdir(parents=True, exist_ok=True)
    able = []
    for setting in (s for s in SETTINGS if s.name in (chosen.only or [s.name])):
        problem = setting.problem()
        able += [] if problem else [setting]
        if problem:
            print(f"{setting.name:<16} left out: {problem}")
    runs = [(number, setting) for number in range(1, chosen.repeat + 1) for setting in able]
    passed = [play(setting, chosen.folder, number, pytest_args) for number, setting in runs]
    return 0 if all(passed) else 1


if __name__ == "__main__":
    sys.exit(main())
