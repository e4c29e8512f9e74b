"""Robots: MJCF and descriptions, changed; what loads is simulated for a moment."""

from __future__ import annotations

import copy
import os
import re
import xml.etree.ElementTree as ET
from functools import cache
from pathlib import Path

import numpy as np
from hypothesis import strategies as st

from poise.configs.files import packaged_folder
from poise.envs.balance.torque import TorqueBalanceEnv
from poise.envs.robots.robot import load_robot

from .texts import Draw, byte_edits, changed, edit_bytes
from .values import Json, decode, packed

NAMES = ("compact", "tall", "toddler")
ATTRIBUTES = [
    *("0", "1", "-1", "1e-300", "1e300", "1e9", "2147483648", "99999999999999999999", "nan", "inf"),
    *("", "a", "0 0 0", "1 2", "1 1 1 1", "0 0 0 0", "true", "auto", "1e-9 1e-9 1e-9", "1 nan 1"),
    *(
        "1 " * 500,
        "x" * 300,
        "x" * 70_000,
        "box",
        "sphere",
        "mesh",
        "plane",
        "hfield",
        "sdf",
        "ball",
    ),
    *("free", "slide", "hinge", "../../nowhere.obj", "/dev/null", "ground", "pelvis", "world"),
    *("radian", "degree", "-1 1", "1 -1", "1000000", "100000000", "\u00e9"),
]
ELEMENTS = [
    '<body name="b"><freejoint/><geom size="1"/></body>',
    '<body pos="0 0 1"><joint type="ball"/><geom size=".1"/></body>',
    '<geom type="box" size="0 0 0"/>',
    '<geom type="mesh" mesh="nowhere"/>',
    '<geom type="hfield" hfield="h"/>',
    '<joint name="j" type="hinge" range="1 -1" limited="true"/>',
    '<replicate count="3" offset="0 0 1"><body><geom size=".1"/></body></replicate>',
    '<replicate count="1000000000" offset="0 0 1"><body><geom size=".1"/></body></replicate>',
    '<replicate count="10000"><replicate count="10000"><geom size=".1"/></replicate></replicate>',
    '<composite type="cable" count="100000 1 1" offset="0 0 1"><geom size=".1"/></composite>',
    '<flexcomp type="grid" count="300 300 300" spacing=".1 .1 .1" name="f"/>',
    '<include file="robot.xml"/>',
    '<include file="nowhere.xml"/>',
    '<include file="/dev/zero"/>',
    '<include file="pipe"/>',
    '<include file="../outside.xml"/>',
    '<include file="folder"/>',
    '<asset><mesh name="nowhere" file="nowhere.obj"/></asset>',
    '<asset><mesh name="p" file="pipe"/><texture name="q" type="2d" file="pipe"/></asset>',
    '<asset><mesh name="many" file="many.stl"/></asset>',
    '<asset><mesh name="link" file="link.stl"/></asset>',
    '<asset><model name="p" file="pipe"/></asset>',
    '<asset><hfield name="p" file="pipe" size="1 1 1 1"/></asset>',
    '<deformable><skin name="p" file="pipe"/></deformable>',
    '<flexcomp type="mesh" file="pipe" name="p"/>',
    '<extension><plugin plugin="nowhere"/></extension>',
    '<asset><mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset>',
    '<asset><mesh name="m" builtin="sphere" params="9"/></asset>',
    '<asset><hfield name="h" nrow="40000" ncol="40000" size="1 1 1 1"/></asset>',
    '<asset><hfield name="h" file="/dev/zero" size="1 1 1 1"/></asset>',
    '<asset><texture name="t" builtin="flat" type="2d" width="200000" height="200000"/></asset>',
    '<asset><texture name="t" type="2d" file="/dev/zero"/></asset>',
    '<size memory="100G"/>',
    '<size nuser_geom="2000000000"/>',
    '<size njmax="2000000000" nconmax="2000000000"/>',
    '<option timestep="0"/>',
    '<option timestep="nan" gravity="nan 0 0" iterations="-1"/>',
    '<option iterations="2000000000" tolerance="-1" solver="CG"/>',
    '<compiler angle="radian" inertiafromgeom="true" boundmass="nan"/>',
    '<compiler meshdir="/" balanceinertia="true"/>',
    '<default><geom friction="-1 nan 1e300"/></default>',
    '<equality><weld body1="pelvis"/></equality>',
    '<contact><exclude body1="pelvis" body2="nowhere"/></contact>',
    '<keyframe><key name="k" qpos="1 2 3"/></keyframe>',
    '<custom><numeric name="n" size="2000000000" data="1"/></custom>',
    '<tendon><spatial><site site="nowhere"/></spatial></tendon>',
    '<sensor><touch site="nowhere"/><user dim="100000000" name="u"/></sensor>',
    '<extension><plugin plugin="mujoco.elasticity.cable"/></extension>',
    '<actuator><general joint="nowhere" dyntype="user"/></actuator>',
    '<visual><global offwidth="100000000" offheight="100000000"/></visual>',
]
CHANGES = ["scale", "scale", "scale", "set", "set", "add", "move", "drop", "rename"]
FACTORS = [-1.0, 0.0, 0.5, 2.0, 10.0, 0.1, 1e3, 1e-3, 1e6, 1e-6, 1e12, 1e-12, 1e300]


@cache
def _file(name: str, suffix: str) -> bytes:
    return (packaged_folder("robots") / f"{name}.{suffix}").read_bytes()


def _edit_element(draw: Draw, root: ET.Element) -> None:
    """One change of one element."""
    nodes = list(root.iter())
    node, other = draw(st.sampled_from(nodes)), draw(st.sampled_from(nodes))
    change = draw(st.sampled_from(CHANGES))
    if change == "set":
        names = sorted({*node.attrib, "name", "pos", "type", "class", "mass"})
        node.set(draw(st.sampled_from(names)), draw(st.sampled_from(ATTRIBUTES)))
    elif change == "scale" and node.attrib:
        name = draw(st.sampled_from(sorted(node.attrib)))
        node.set(name, _scaled(draw, node.attrib[name]))
    elif change == "add":
        node.append(ET.fromstring(draw(st.sampled_from(ELEMENTS))))
    elif change == "drop":
        for child in list(node)[:1]:
            node.remove(child)
    elif change == "move":
        node.append(copy.deepcopy(other))
    else:
        node.tag = other.tag


def _scaled(draw: Draw, text: str) -> str:
    """An attribute with one of its numbers multiplied."""
    words = text.split()
    numbers = [i for i, word in enumerate(words) if re.fullmatch(r"[-+.\deE]*\d[-+.\deE]*", word)]
    if numbers:
        i = draw(st.sampled_from(numbers))
        words[i] = repr(float(words[i]) * draw(st.sampled_from(FACTORS)))
    return " ".join(words)


def edit_xml(draw: Draw, content: bytes) -> bytes:
    root = ET.fromstring(content)
    for _ in range(draw(st.integers(1, 3))):
        _edit_element(draw, root)
    return ET.tostring(root)


@st.composite
def cases(draw: Draw) -> Json:
    """MJCF and description, one of them changed."""
    name = draw(st.sampled_from(NAMES))
    mjcf, description = _file(name, "xml"), _file(name, "yaml")
    what = draw(st.sampled_from(["elements"] * 5 + ["bytes", "description"]))
    if what == "elements":
        mjcf = edit_xml(draw, mjcf)
    elif what == "bytes":
        mjcf = edit_bytes(mjcf, byte_edits(draw, len(mjcf)))
    else:
        description = changed(draw, description)
    return {"robot": name, "mjcf": packed(mjcf), "description": packed(description)}


def write_strange(folder: Path) -> None:
    """What models name that is no model: a pipe, a folder, a link outside, a mesh of 10⁸ faces."""
    os.mkfifo(folder / "pipe")
    (folder / "folder").mkdir()
    os.symlink("/etc/passwd", folder / "link.stl")
    (folder / "many.stl").write_bytes(bytes(80) + (10**8).to_bytes(4, "little") + bytes(50))
    (folder.parent / "outside.xml").write_text("<mujoco><worldbody/></mujoco>")


def play(case: Json, folder: Path) -> None:
    """Load the robot; if it loads, let it stand for three policy steps."""
    write_strange(folder)
    (folder / f"{case['robot']}.xml").write_bytes(decode(case["mjcf"]))
    path = folder / f"{case['robot']}.yaml"
    path.write_bytes(decode(case["description"]))
    stand(path)


def stand(path: Path) -> None:
    """Load a robot, and let it stand for three policy steps."""
    env = TorqueBalanceEnv(load_robot(path))
    observation, _ = env.reset(seed=0)
    for _ in range(3):
        assert observation in env.observation_space, "an observation outside its space"
        if env.episode.running:
            observation = env.step(np.zeros(len(env.action_names)))[0]
