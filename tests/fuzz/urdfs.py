"""Robots as URDF, changed; what loads is simulated for a moment."""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path

from hypothesis import strategies as st

from tests.support.small_urdf import mesh, write_urdf

from . import robots
from .texts import Draw, byte_edits, changed, edit_bytes
from .values import Json, decode, packed

MESHES = ("pipe", "folder", "many.stl", "link.stl", "missing.stl", "../outside.xml", "/dev/zero",
          "package://nowhere/a.stl", "package://../../a", "file:///etc/passwd", "", "a.dae",
          "x" * 300)  # fmt: skip
BEGINNINGS = (
    '<!DOCTYPE robot [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;">]>',
    '<!DOCTYPE robot SYSTEM "file:///etc/passwd">',
    '<?xml version="1.0" encoding="utf-16"?>',
    '<?xml version="1.0" encoding="nowhere"?>',
    "<!-- ",
    "\ufeff",
)
EXTRAS = (
    '<link name="trunk"/>',
    '<joint name="j" type="floating"><parent link="left_foot"/><child link="l"/></joint>',
    '<link name="l"/><joint name="j" type="planar"><parent link="trunk"/><child link="l"/></joint>',
    '<link name="l"/><joint name="j" type="fixed"><parent link="l"/><child link="l"/></joint>',
    '<link name="l"><inertial><mass value="nan"/></inertial></link>',
    '<mujoco><compiler meshdir="/" strippath="true"/><size memory="100G"/></mujoco>',
    "<a>" * 5000,
    "<link/>" * 30_000,
)


@cache
def _files() -> tuple[bytes, bytes]:
    """The URDF file of a small biped, and its description."""
    with tempfile.TemporaryDirectory() as folder:
        path = write_urdf(Path(folder))
        return (Path(folder) / "biped.urdf").read_bytes(), path.read_bytes()


@st.composite
def cases(draw: Draw) -> Json:
    """URDF and description, one of them changed."""
    urdf, description = _files()
    what = draw(st.sampled_from(["elements"] * 3 + ["bytes", "mesh", "begin", "extra", "words"]))
    if what == "elements":
        urdf = robots.edit_xml(draw, urdf)
    elif what == "bytes":
        urdf = edit_bytes(urdf, byte_edits(draw, len(urdf)))
    elif what == "mesh":
        kind = draw(st.sampled_from(["collision", "visual"]))
        named = mesh(draw(st.sampled_from(MESHES)), kind).encode()
        urdf = urdf.replace(b"</link>", named + b"</link>", 1)
    elif what == "begin":
        urdf = draw(st.sampled_from(BEGINNINGS)).encode() + urdf
    elif what == "extra":
        urdf = urdf.replace(b"</robot>", draw(st.sampled_from(EXTRAS)).encode() + b"</robot>")
    else:
        description = changed(draw, description)
    return {"urdf": packed(urdf), "description": packed(description)}


def play(case: Json, folder: Path) -> None:
    """Load the robot; if it loads, let it stand for three policy steps."""
    robots.write_strange(folder)
    (folder / "biped.urdf").write_bytes(decode(case["urdf"]))
    path = folder / "biped.yaml"
    path.write_bytes(decode(case["description"]))
    robots.stand(path)
