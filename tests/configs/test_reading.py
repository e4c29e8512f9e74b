"""Files of anybody: every loader reads them within bounds and answers in one line.

configs/reading.py, configs/archives.py, configs/yaml_loader.py, and the loaders of all kinds.
"""

from __future__ import annotations

import io
import os
import zipfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from poise.baselines.balance.references.motion import load_motion
from poise.baselines.environments.guard.config import guard_config
from poise.baselines.motion.space_time.constraints.constraint import read_constraints
from poise.baselines.registry import controller_config
from poise.configs.archives import MEMBERS, UNPACKED_BYTES, Archive, read_arrays
from poise.configs.errors import ConfigError, PoiseError, shown
from poise.configs.files import packaged, resolve
from poise.configs.reading import (
    MIB,
    YAML_BYTES,
    exists,
    is_file,
    is_folder,
    parse_json,
    read_bytes,
    read_json,
    read_table,
    read_yaml,
)
from poise.configs.schema import build
from poise.configs.yaml_loader import DEPTH, DIGITS, NODES
from poise.envs.balance.config import EnvConfig, env_config
from poise.envs.physics.engines.config import load_physics
from poise.envs.robots.robot import load_robot
from poise.envs.sensing.realism import load_realism
from poise.training.benchmarking.suites.suite import load_suite
from poise.training.benchmarking.trials.agents import load_agent
from poise.training.benchmarking.trials.push_limits import load_limits
from poise.training.learning.config import train_config
from poise.training.learning.policy import load_policy
from poise.training.learning.tuning.search import tune_config
from poise.training.motion.gaits.knee_moment import load_knee_moment
from tests.support.hangs import no_hang
from tests.support.shared import robot

LOADERS: dict[str, Callable[[Any], Any]] = {
    "realism": load_realism,
    "robots": load_robot,
    "envs": env_config,
    "controllers": controller_config,
    "rivals": controller_config,
    "guards": guard_config,
    "motions": lambda path: load_motion(path, robot()),
    "suites": load_suite,
    "training": train_config,
    "tuning": tune_config,
    "limits": lambda path: load_limits(robot(), path),
    "human": load_knee_moment,
    "constraints": read_constraints,
    "physics": load_physics,
}
BOMB = "".join(f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]\n" for k in range(1, 12))
BOMB = f"a0: &a0 [x, x, x, x, x, x, x, x, x]\n{BOMB}"
MERGES = "a0: &a0 {x: 1}\n" + "".join(
    f"a{k}: &a{k} {{<<: [{', '.join([f'*a{k - 1}'] * 9)}]}}\n" for k in range(1, 12)
)
CHAIN = "a0: &a0 []\n" + "".join(f"a{k}: &a{k} [*a{k - 1}]\n" for k in range(1, 2000))
COLLIDING = "\n".join(f"{k * (2**61 - 1)}: 1" for k in range(1, 20_000))  # equal as hashes
MERGED = "".join(
    f"a{n}: &a{n} {{{', '.join(f'{(2**61 - 1) * (900 * n + k)}: 1' for k in range(1, 900))}}}\n"
    for n in range(8)
)
MALFORMED = {
    "comments": (("#" * 500 + "\n") * 2000 + "{", "not valid YAML"),
    "blanks": (" " * 1_000_000 + "{", "not valid YAML"),
    "colliding": (COLLIDING, "more than 1000 entries"),
    "colliding merged": (
        f"{MERGED}<<: [{', '.join(f'*a{n}' for n in range(8))}]\n",
        "more than 1000 entries",
    ),
    "aliases": (BOMB, "more than 50000 values"),
    "merged": (MERGES, "more than 50000 values"),
    "chained": (CHAIN, "more than 64 levels"),
    "itself": ("a: &a [*a]\n", "an alias of what it stands in"),
    "repeated text": (f"a: &a {'x' * 600_000}\nb: [{'*a, ' * 20}]\n", "more than 50000 values"),
    "deep": ("a: " + "[" * 1000, "more than 64 levels"),
    "deep blocks": ("- " * 1000, "more than 64 levels"),
    "long": ("a: [" + "1," * 2 * NODES + "]", "more than 50000 values"),
    "timestamp": ("a: !!timestamp abc\n", "'abc' is no timestamp"),
    "bool": ("a: !!bool abc\n", "'abc' is no bool"),
    "int": ("a: !!int ''\n", "'' is no int"),
    "float": ("a: !!float x\n", "'x' is no float"),
    "binary": ("a: !!binary é\n", "not valid YAML"),
    "sexagesimal": ("a: 1" + ":0" * 180 + ".0\n", "is no float"),
    "hexadecimal": (f"a: 0x{'f' * 5000}\n", "more than 308 digits"),
    "short hexadecimal": (f"a: 0x{'f' * 300}\n", "more than 308 digits"),
    "decimal": (f"a: {'9' * 5000}\n", "more than 308 digits"),
    "key": (f"{'k' * 500}: 1\n", "unknown field|kind"),
    "two lines": ('"a\\nb": 1\n', "unknown field|kind"),
    "set": ("!!set {a, b}\n", "must hold a mapping"),
    "latin": (b"a: 1\nb: \xe9\n", "not valid YAML: line 2: not UTF-8"),
    "a control": (b"\xc3\xa9: 1\n\nb: \x07\n", "not valid YAML: line 3: the character U+0007"),
}


def message(call: Callable[[], Any]) -> str:
    """The text of the error that a call raises: one short line that can be printed."""
    with no_hang(), pytest.raises(PoiseError) as caught:
        call()
    text = str(caught.value)
    assert text.isprintable() and len(text) < 5000
    return text


def write(path: Path, content: str | bytes) -> Path:
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def test_every_packaged_kind_is_tried() -> None:
    """What lies in configs is loaded by one of the loaders here, or is a policy."""
    folder = Path(str(resolve("robots", "humanoid"))).parents[1]
    kinds = {path.name for path in folder.iterdir() if packaged(path.name)}
    assert kinds <= {*LOADERS, "policies"}


@pytest.mark.parametrize("what", MALFORMED)
def test_malformed_yaml_is_one_line(tmp_path: Path, what: str) -> None:
    """Bombs, malformed scalars and endless numbers: the file, the place and what is wrong."""
    content, problem = MALFORMED[what]
    path = write(tmp_path / "bad.yaml", content)
    if problem == "unknown field|kind":
        assert message(lambda: build(EnvConfig, read_yaml(path), path)).startswith(str(path))
        return
    text = message(lambda: read_yaml(path))
    assert text.startswith(f"{path}: ") and problem in text


@pytest.mark.parametrize("kind", LOADERS)
def test_every_kind_refuses_all_of_them(tmp_path: Path, kind: str) -> None:
    """Each loader, each malformed file, and each as a value of a field: one line with the path."""
    for what, (content, problem) in MALFORMED.items():
        if len(content) > 50_000:  # a second each
            continue
        path = write(tmp_path / "bad.yaml", content)
        text = message(partial(LOADERS[kind], path))
        assert text.startswith(f"{path}: "), (what, text)
        assert problem in text or "|" in problem, (what, text)


def test_packaged_files_are_what_both_parsers_of_yaml_read() -> None:
    """PyYAML without its C library refuses some texts that it takes with it."""
    paths = sorted((Path(__file__).parents[2] / "configs").rglob("*.yaml"))
    assert len(paths) > 100
    for path in paths:
        text = path.read_text()
        plain = yaml.load(text, Loader=yaml.SafeLoader)
        assert plain == yaml.load(text, Loader=yaml.CSafeLoader), path


NAMES = ["x" * 300, "x" * 300 + ".yaml", "a\0b.yaml", "a\nb.yaml", "x/" * 3000 + "a.yaml",
         "\ud800.yaml", "é" * 200 + ".yaml", "x" * 1_000_000, ""]  # fmt: skip


@pytest.mark.parametrize("kind", LOADERS)
def test_names_that_no_file_can_have(kind: str) -> None:
    """Too long, with a NUL, a line break or half a character: no such name, by each loader."""
    for name in NAMES:
        assert "no such" in message(partial(LOADERS[kind], name))


@pytest.mark.parametrize("kind", ["controllers", "training", "tuning"])
def test_names_of_bases(tmp_path: Path, kind: str) -> None:
    """A `base` that no file can have, is no text, or of too many on each other."""
    for name in NAMES:
        if name.isprintable():
            path = write(tmp_path / "bad.yaml", f"base: {name or chr(34) * 2}\n")
            assert "no such" in message(partial(LOADERS[kind], path))
    for k in range(40):
        write(tmp_path / f"{k}.yaml", f"base: {tmp_path}/{k + 1}.yaml\n")
    assert "more than 32" in message(lambda: LOADERS[kind](tmp_path / "0.yaml"))


@pytest.mark.parametrize("name", NAMES[:-1])
def test_names_of_agents_and_policies(name: str) -> None:
    """No controller and no policy is called so."""
    assert "no such" in message(lambda: load_agent(name, robot()))
    assert "no such" in message(lambda: load_policy(name))
    assert not is_file(name) and not exists(f"{name}\0") and not is_folder(f"{name}\0")


@pytest.mark.parametrize("kind", LOADERS)
@pytest.mark.parametrize("name", [3, 1.5, [1], b"x", object()])
def test_a_name_is_text_or_a_path(kind: str, name: Any) -> None:
    """A number or a list is none."""
    assert "must be" in message(lambda: LOADERS[kind](name))


def test_files_that_are_none(tmp_path: Path) -> None:
    """Too large, a folder, a device, a pipe, which is not waited for, and a file of nobody."""
    large = tmp_path / "large.yaml"
    with large.open("wb") as file:
        file.truncate(YAML_BYTES + 1)
    assert message(lambda: read_yaml(large)) == f"{large}: is larger than 1 MiB"
    assert "not a regular file" in message(lambda: read_yaml(tmp_path))
    assert "not a regular file" in message(lambda: read_bytes("/dev/zero", MIB))
    pointer = tmp_path / "pointer.bvh"
    pointer.write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 3\n")
    assert "is a pointer of Git LFS" in message(lambda: read_bytes(pointer, MIB))
    os.mkfifo(tmp_path / "pipe.yaml")
    assert "not a regular file" in message(lambda: read_yaml(tmp_path / "pipe.yaml"))
    assert "no name of a file" in message(lambda: read_yaml("a\0b"))
    assert "File name too long" in message(lambda: read_yaml("a" * 300))


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("[" * 100_000, "levels"),
        ('{"a": ' * (DEPTH + 1) + "1" + "}" * (DEPTH + 1), "levels"),
        ('{"a": ' + "9" * (DIGITS + 1) + "}", "more than 308 digits"),
        ('{"a": ' + "9" * 5000 + "}", "more than 308 digits"),
        ("[1]", "must be a mapping"),
        ("", "is not valid JSON"),
        (b"\xff\xfe", "cannot be read"),
    ],
)
def test_malformed_json_is_one_line(tmp_path: Path, text: str | bytes, problem: str) -> None:
    """Deep, long or no JSON."""
    path = write(tmp_path / "summary.json", text)
    found = message(lambda: read_json(path))
    assert found.startswith(f"{path}: ") and problem in found


def test_json_within_the_bounds_is_read() -> None:
    """64 levels and 308 digits."""
    value = parse_json("[" * DEPTH + "9" * DIGITS + "]" * DEPTH)
    for _ in range(DEPTH):
        (value,) = value
    assert value == 10**DIGITS - 1 and float(value) < np.inf


@pytest.mark.parametrize(
    "text", ["a,b\n1\n", "a,b\n1,2,3\n", "a\n" + "x" * 200_000, b"a,b\n\xff,1\n"]
)
def test_malformed_tables_are_one_line(tmp_path: Path, text: str | bytes) -> None:
    """A line that is cut off or too long, a field without end, no text."""
    path = write(tmp_path / "trials.csv", text)
    assert message(lambda: read_table(path)).startswith(f"{path}: ")


def zipped(method: int = zipfile.ZIP_DEFLATED, **members: bytes) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", method) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return file.getvalue()


def test_archives_unpack_within_bounds() -> None:
    """By what they declare, by what they are, by how many and by how they are packed."""
    zeros = bytes(UNPACKED_BYTES // 4)
    four = {str(k): zeros for k in range(4)}
    assert Archive(zipped(**four), "a.zip").read("0") == zeros
    assert "more than 128 MiB" in message(lambda: Archive(zipped(**four, more=b"x"), "a.zip"))
    many = {str(k): b"" for k in range(MEMBERS + 1)}
    assert "more than 1000 files" in message(lambda: Archive(zipped(**many), "a.zip"))
    for method in (zipfile.ZIP_LZMA, zipfile.ZIP_BZIP2):
        data = zipped(method, a=b"x" * 1000)
        assert "another method" in message(partial(Archive, data, "a.zip"))
    assert "BadZipFile" in message(lambda: Archive(b"x", "a.zip"))
    assert "KeyError" in message(lambda: Archive(zipped(), "a.zip").read("none"))


def test_an_archive_that_lies_about_its_sizes() -> None:
    """A member of 100 kB that declares 10 bytes gives an error, not what it unpacks to."""
    data, size = zipped(a=bytes(100_000)), (100_000).to_bytes(4, "little")
    assert data.count(size) == 2
    lying = data.replace(size, (10).to_bytes(4, "little"))
    assert message(lambda: Archive(lying, "a.zip").read("a")).startswith("a.zip: ")


def header(text: str) -> bytes:
    """An .npy file with this header and nothing else."""
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text.encode()


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\x93NUMPY",
        b"\x93NUMPY\x02\x00\xff\xff\xff\xff",
        header(""),
        header("{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,)}\n"),
        header("{'descr': '<f8', 'fortran_order': False, 'shape': (-1,)}\n"),
        header("{'descr': '<c16', 'fortran_order': False, 'shape': (0,)}\n"),
        header("{'descr': '|O', 'fortran_order': False, 'shape': (0,)}\n"),
        header("{'descr': [('a', '<f8')], 'fortran_order': False, 'shape': (0,)}\n"),
        header("{'descr': '<M8[s]', 'fortran_order': False, 'shape': (0,)}\n"),
        header("(" * 500),
        header("{'descr': \0"),
        header("{" * 60_000),
    ],
)
def test_arrays_with_broken_headers_are_one_line(tmp_path: Path, data: bytes) -> None:
    """Empty, cut off, larger than their file, of another type: one line with the path."""
    path = write(tmp_path / "a.npz", zipped(**{"x.npy": data}))
    assert message(lambda: read_arrays(path, ["x"])).startswith(f"{path}: ")


@pytest.mark.parametrize("dtype", ["<f8", ">f8", "<f4"])
@pytest.mark.parametrize("shape", [(), (3,), (2, 3)])
def test_arrays_are_read_as_numpy_reads_them(tmp_path: Path, dtype: str, shape: tuple) -> None:
    """The same numbers, as 64-bit floats, in memory of their own."""
    x = np.random.default_rng(0).normal(size=shape).astype(dtype)
    np.savez(tmp_path / "a.npz", x=x, y=x.copy(order="F"))
    arrays = read_arrays(tmp_path / "a.npz", ["x", "y"])
    for found in arrays.values():
        assert found.dtype == float and found.flags.writeable and np.array_equal(found, x)


def test_values_in_errors_are_short() -> None:
    """Whatever it is, and however often it holds itself."""
    tower: Any = ["x"]
    for _ in range(60):
        tower = [tower] * 9
    ring: list[Any] = []
    ring.append(ring)

    class Rude:
        def __repr__(self) -> str:
            raise RuntimeError

    for value in (tower, ring, Rude(), 10**5000, "x" * 10**6, "a\n\x1b[31m", {"k": tower},
                  np.zeros(10**6), b"x" * 10**6):  # fmt: skip
        text = shown(value)
        assert len(text) <= 170 and text.isprintable()
        assert len(message(partial(build, EnvConfig, {"duration": value}, "a"))) < 300
    assert shown(10**5000) == "a whole number of about 5001 digits"
    assert [shown(value) for value in ("a", 1.5, None, [1, "b"])] == ["'a'", "1.5", "None",
                                                                      "[1, 'b']"]  # fmt: skip


def test_errors_are_one_line_whatever_they_hold() -> None:
    """Line breaks, escapes and a million characters in each of its parts."""
    for part in ("a\nb\r\nc", "\x1b[31m\0\ud800", "x" * 10**6):
        error = ConfigError(part, source=part, field=part, choices=[part] * 1000)
        assert str(error).isprintable() and len(str(error)) < 5000
        assert str(PoiseError(part)).isprintable() and len(str(PoiseError(part))) < 5000
    assert str(ConfigError("a  b", source="c  d")) == "c  d: a  b"


def test_no_more_memory_is_taken_than_a_file_has(tmp_path: Path) -> None:
    """A bound far beyond this machine's memory is none for a small file, nor for one of /proc."""
    small = tmp_path / "small"
    small.write_bytes(b"abc")
    assert read_bytes(small, 1 << 46) == b"abc" == read_bytes(small, 3)
    with pytest.raises(ConfigError, match="is larger than"):
        read_bytes(small, 2)
    status = Path("/proc/self/status")
    if status.exists():
        assert b"VmRSS" in read_bytes(status, 1 << 46)
