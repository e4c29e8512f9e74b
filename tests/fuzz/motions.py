"""Files of motions: BVH, postures of a robot, scripts, graphs, constraints; and terrains."""

from __future__ import annotations

import io
import tempfile
import zipfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st

from poise.baselines.balance.references.motion import load_motion
from poise.baselines.balance.references.robot_clip import About, RobotClip, write_robot_clip
from poise.baselines.motion.graphs.motion_graph import read_graph, write_graph
from poise.baselines.motion.retargeting.performed import load_clip
from poise.baselines.motion.space_time.constraints.constraint import read_constraints
from poise.baselines.motion.synthesis.scripts.parser import read_script
from poise.configs.files import packaged_folder
from poise.configs.reading import read_yaml
from poise.envs.terrain.terrain import make_terrain
from tests.support.motion_files import small_bvh
from tests.support.motion_graphs import random_graph
from tests.support.shared import robot

from .policies import ARRAYS, METHODS
from .texts import Draw, byte_edits, changed, edit_bytes
from .values import Json, decode, packed

FORMS = {"bvh": ".bvh", "postures": ".npz", "script": ".motion", "graph": ".yaml",
         "constraints": ".yaml", "terrain": ".yaml"}  # fmt: skip
TERRAINS = (
    "kind: flat",
    "kind: slope\ngradient: 0.1\nerror: 0.01\nseed: 3",
    "kind: stairs\nrise: 0.1\nerror: 0.02\nunseen: true",
    "kind: stones\nerror: 0.01",
)


def _terrain(path: Path) -> None:
    terrain = make_terrain(read_yaml(path))
    assert np.isfinite([terrain.height(x, 0.0) for x in (-1.0, 0.0, 1.0, 10.0)]).all()


READERS: dict[str, Callable[[Path], Any]] = {
    "bvh": load_clip,
    "postures": lambda path: load_motion(path, robot()),
    "script": read_script,
    "graph": read_graph,
    "constraints": read_constraints,
    "terrain": _terrain,
}


@cache
def _postures() -> bytes:
    """A robot that crouches a little, both soles planted."""
    frames = 12
    qpos = np.tile(robot().standing_qpos, (frames, 1))
    qpos[:, 2] -= 0.01 * np.sin(np.linspace(0.0, np.pi, frames))
    about = About("humanoid", robot().fingerprint, "crouch")
    clip = RobotClip(about, 0.05, qpos, np.ones((frames, 2), dtype=bool))
    return _written(lambda path: write_robot_clip(clip, path), "a.npz")


@cache
def _graph() -> bytes:
    graph = random_graph(np.random.default_rng(0), 4, 2, 0.6)
    return _written(lambda path: write_graph(graph, path), "a.yaml")


def _written(write: Callable[[Path], None], name: str) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder) / name)
        return (Path(folder) / name).read_bytes()


def _sample(draw: Draw, kind: str) -> bytes:
    if kind == "bvh":
        return small_bvh().encode()
    if kind == "graph":
        return _graph()
    if kind == "terrain":
        return str(draw(st.sampled_from(TERRAINS))).encode()
    folder = packaged_folder({"script": "scripts"}.get(kind, kind))
    return draw(st.sampled_from([path.read_bytes() for path in sorted(folder.glob("*.*"))]))


def _edit_archive(draw: Draw) -> bytes:
    """The archive of postures, with one member changed."""
    names = ("qpos.npy", "dt.npy", "planted.npy", "about.json")
    with zipfile.ZipFile(io.BytesIO(_postures())) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    name = draw(st.sampled_from([name for name in names if name in members] or sorted(members)))
    if name.endswith(".npy") and draw(st.booleans()):
        array = np.load(io.BytesIO(members[name]), allow_pickle=False)
        text = io.BytesIO()
        kept = sorted(set(ARRAYS) - {"bomb"})
        np.save(text, ARRAYS[draw(st.sampled_from(kept))](array))
        members[name] = text.getvalue()
    elif name.endswith(".json"):
        members[name] = changed(draw, members[name], "json")
    else:
        members[name] = edit_bytes(members[name], byte_edits(draw, min(len(members[name]), 200)))
    result = io.BytesIO()
    with zipfile.ZipFile(result, "w", METHODS[draw(st.sampled_from(sorted(METHODS)))]) as archive:
        for each, content in members.items():
            archive.writestr(each, content)
    return result.getvalue()


@st.composite
def cases(draw: Draw) -> Json:
    """What kind of file, and the file."""
    kind = draw(st.sampled_from(sorted(FORMS)))
    if kind == "postures" and draw(st.booleans()):
        content = _edit_archive(draw)
    elif kind == "postures":
        content = edit_bytes(_postures(), byte_edits(draw, len(_postures())))
    else:
        form = "yaml" if FORMS[kind] == ".yaml" else "text"
        content = changed(draw, _sample(draw, kind), form)
    return {"of": kind, "file": packed(content)}


def play(case: Json, folder: Path) -> None:
    """Read it."""
    path = folder / f"case{FORMS[case['of']]}"
    path.write_bytes(decode(case["file"]))
    READERS[case["of"]](path)
