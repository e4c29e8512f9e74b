"""Compiled kernels are kept apart for everything that their bits depend on."""

import os
import pickle
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest

from poise.configs.errors import ConfigError
from poise.envs.compiled import jit
from poise.envs.compiled.cache_folder import kernel_folder
from poise.envs.compiled.sources import source_digest

#: Prints the folder of the kernels, whether one was read from it, and the bits of a sum that
#: `fastmath` reorders and fuses.
PROBE = """
import numpy as np
from poise.envs.compiled import jit
from tests.envs.compiled.test_kernel_cache import total

x = 1.0 / np.arange(3.0, 103.0)
value = total(x, x[::-1].copy())
print(jit.CACHE, sum(total.stats.cache_hits.values()), value.hex())
"""


@jit.compiled
def total(x, y):
    """A scalar product, one product after the other."""
    value = 0.0
    for i in range(x.shape[0]):
        value += x[i] * y[i]
    return value


def probe(room: Path, **settings: str) -> tuple[Path, int, str]:
    """What PROBE prints in a process with these settings, its kernels somewhere below `room`.

    The tests themselves may run as another processor.
    """
    ours = ("NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES", "POISE_FASTMATH")
    rest = {name: value for name, value in os.environ.items() if name not in ours}
    environment = rest | {"NUMBA_CACHE_DIR": str(room)} | settings
    command = [sys.executable, "-c", PROBE]
    done = subprocess.run(
        command, env=environment, capture_output=True, text=True, check=True,
        cwd=Path(__file__).parents[3],
    )  # fmt: skip
    folder, hits, value = done.stdout.split()
    return Path(folder), int(hits), value


def test_kernels_with_and_without_fastmath_do_not_mix(tmp_path: Path) -> None:
    """Each process has kernels of its own kind, and without fastmath nothing is reordered."""
    x = 1.0 / np.arange(3.0, 103.0)
    in_order = 0.0
    for a, b in zip(x.tolist(), x[::-1].tolist(), strict=True):
        in_order += a * b
    fast, strict = (probe(tmp_path, POISE_FASTMATH=switch) for switch in "10")
    assert fast[0] != strict[0] and fast[1] == strict[1] == 0
    assert strict[2] == in_order.hex()


def test_processors_have_caches_of_their_own(tmp_path: Path, monkeypatch) -> None:
    """The name and the features that Numba compiles for are part of the folder's name."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    host, _ = kernel_folder([])
    monkeypatch.setattr(numba.config, "CPU_FEATURES", "")
    plain, _ = kernel_folder([])
    monkeypatch.setattr(numba.config, "CPU_NAME", "generic")
    generic, _ = kernel_folder([])
    assert len({host, generic, plain, kernel_folder(["contract"])[0]}) == 4


@pytest.mark.parametrize("switch", ["", "2", "yes", " 1"])
def test_the_switch_is_0_or_1(switch: str) -> None:
    """Anything else is refused with the choices."""
    with pytest.raises(ConfigError, match=r"POISE_FASTMATH: .*\(choices: 0, 1\)"):
        jit.fastmath({"POISE_FASTMATH": switch})


def test_the_flags_keep_nan_and_infinity() -> None:
    """Checks rely on them; by default the other flags are set, with 0 none."""
    assert jit.fastmath({}) == jit.fastmath({"POISE_FASTMATH": "1"}) == set(jit.FAST)
    assert not set(jit.FAST) & {"fast", "nnan", "ninf", "afn"}
    assert jit.fastmath({"POISE_FASTMATH": "0"}) == set()


def test_one_process_compiles_and_the_others_wait_and_read(tmp_path: Path) -> None:
    """Or the kernel that a process goes on with would not be the one that later ones read."""
    code = PROBE.replace("x = 1.0", "input()\nx = 1.0", 1)  # all import, then begin together
    jobs = [
        subprocess.Popen(
            [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
            env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}, cwd=Path(__file__).parents[3],
        )
        for _ in range(3)
    ]  # fmt: skip
    for job in jobs:
        assert job.stdin is not None
        job.stdin.write("\n")
        job.stdin.flush()
    read = [int(job.communicate()[0].split()[1]) for job in jobs]
    assert sorted(read) == [0, 1, 1]


@pytest.mark.weekly
def test_the_process_that_compiles_goes_on_with_the_bits_of_those_that_read(tmp_path: Path) -> None:
    """Every quantity of a tick, whose kernel calls others that do not fit into it."""
    code = "from tests.envs.compiled.test_copies import played; print(played('state').expected)"
    seen = [
        subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True,
            env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}, cwd=Path(__file__).parents[3],
        ).stdout
        for _ in range(2)
    ]  # fmt: skip
    assert seen[0] == seen[1]


def test_a_prepared_kernel_is_read_where_nobody_else_writes(tmp_path: Path) -> None:
    """Kernels are unpickled, which runs what they say: none from a folder that others may write."""
    kept, sprung = Path(total.stats.cache_path), tmp_path / "sprung"
    place = tmp_path / "room" / "poise" / kept.relative_to(jit.CACHE.parent)
    place.mkdir(parents=True)
    for folder in (place, *place.parents[: place.parts[::-1].index("room")]):
        folder.chmod(0o700)
    index = place / f"{total._cache._impl.filename_base}.nbi"
    index.write_bytes(pickle.dumps(Trap(sprung)))
    (tmp_path / "room").chmod(0o777)
    assert probe(tmp_path / "room")[:2] == (Path("None"), 0) and not sprung.exists()
    (tmp_path / "room").chmod(0o700)
    probe(tmp_path / "room")
    assert sprung.exists()  # the user's own folder is trusted


class Trap:
    """Unpickled, it makes a file."""

    def __init__(self, path: Path):
        self.path = path

    def __reduce__(self):
        return Path.touch, (self.path,)


def test_a_kernel_is_kept_in_the_folder_of_its_sources() -> None:
    """Its name has the digest of the file and of what that imports."""
    digest = source_digest(__file__)[:16]
    kept = jit.CACHE / f"compiled.test_kernel_cache-{digest}"
    assert kept in Path(total.stats.cache_path).parents
