"""Models larger than a robot's are refused before MuJoCo builds them;
envs/robots/models/mjcf_bounds.py.
"""

from __future__ import annotations

import os
from pathlib import Path

import mujoco
import pytest

from poise.configs.errors import ConfigError
from poise.envs.robots.models.mjcf import read_mjcf
from poise.envs.robots.models.mjcf_bounds import ASSET_BYTES, KEPT, MJCF_BYTES
from poise.envs.robots.robot import load_robot
from tests.support.hangs import no_hang

BODY = '<body><joint/><geom size="1"/></body>'
PNG = b"\x89PNG\r\n\x1a\n" + bytes(8) + (60_000).to_bytes(4) * 2


def world(inside: str) -> str:
    return f"<worldbody>{inside}</worldbody>"


def asset(inside: str) -> str:
    return f"<asset>{inside}</asset>"


PIPE = "pipe is not a regular file"
BOMBS = {
    "elements": (world('<geom size="1"/>' * 20_001), "20000 elements"),
    "copies": (world(f'<replicate count="30000">{BODY}</replicate>'), "replicate would make"),
    "entities": (world(f'<replicate count="&#51;0000">{BODY}</replicate>'), "replicate would make"),
    "copies of copies": (
        world('<replicate count="200"><!-- </replicate> -->'
              f"<replicate count='200'>{BODY}</replicate></replicate>"), "20000 elements",
    ),
    "copies of many": (world(f'<replicate count="3000">{BODY * 10}</replicate>'), "20000 elements"),
    "cable": (world('<composite type="cable" count="1000 1 1" curve="s" size="1"/>'), "composite"),
    "grid": (world('<body name="b"><flexcomp type="grid" count="25 25 25" spacing="1 1 1" dim="3" '
                   'name="f"/></body>'), "flexcomp would make"),
    "bodies": (world(BODY * 1001), "1000 bodies"),
    "joints": (world(f'<body>{BODY * 10}{"<joint/>" * 1000}<geom size="1"/></body>'),
               "1000 joints"),
    "height field": (asset('<hfield name="h" nrow="40000" ncol="40000" size="1 1 1 1"/>'),
                     "height field"),
    "cube": (asset('<texture name="t" builtin="flat" type="cube" width="20000"/>'), "pixels"),
    "texture file": (asset('<texture name="t" type="2d" file="t.png"/>'), "pixels"),
    "mesh file": (asset('<mesh name="m" file="m.stl"/>'), "m.stl is larger than 16 MiB"),
    "mesh": (asset('<mesh name="m" builtin="supertorus" params="10000 1 1 1"/>'), "params"),
    "memory": ('<size memory="100G"/>', "memory"),
    "document type": ('<!DOCTYPE a [<!ENTITY x SYSTEM "file:///etc/passwd">]>', "document type"),
    "document type of a part": ('<include file="typed.xml"/>', "typed.xml has a document type"),
    **{f"{solver} of {name}": (
        f'<option solver="{solver}" tolerance="0" {name}="2000000000"/>',
        f"option: {name} must be at most 1000",
    ) for solver, name in (("PGS", "iterations"), ("CG", "iterations"), ("Newton", "ls_iterations"),
                           ("PGS", "noslip_iterations"), ("Newton", "sdf_initpoints"))},
    "constraints": ('<size njmax="2000000000"/>', "memory"),
    "keyframes": (f'<size nkey="200000000"/>{world(BODY)}', "nkey"),
    "sensor": ('<sensor><user dim="100000000" name="u"/></sensor>', "numbers each"),
    "actuator": (world('<body><joint name="j"/><geom size="1"/></body>')
                 + '<actuator><general joint="j" dyntype="user" actdim="100000000"/></actuator>',
                 "numbers each"),
    "camera": (world('<camera name="c" resolution="100000 100000"/>'), "a camera"),
    "picture": ('<visual><global offwidth="100000" offheight="100000"/></visual>', "a picture"),
    "size": (f"<!-- {'x' * MJCF_BYTES} -->", "larger than 4 MiB"),
    "device": ('<include file="/dev/zero"/>', "/dev/zero is not a regular file"),
    "pipe": ('<include file="sub/pipe"/>', PIPE),
    "pipe beside an included file": ('<include file="sub/more.xml"/>', PIPE),
    "pipe as a model": (asset('<model name="m" file="sub/pipe"/>'), PIPE),
    "pipe as a field": (asset('<hfield name="h" file="sub/pipe" size="1 1 1 1"/>'), PIPE),
    "pipe as a mesh": ('<compiler meshdir="sub"/>' + asset('<mesh name="m" file="pipe"/>'), PIPE),
    "pipe as a side": ('<compiler assetdir="sub"/>'
                       + asset('<texture name="t" type="cube" fileleft="pipe"/>'), PIPE),
    "pipe as a skin": ('<deformable><skin name="s" file="sub/pipe"/></deformable>', PIPE),
    "pipe as a flex": (world('<body name="b"><flexcomp type="mesh" file="sub/pipe" name="f"/>'
                             "</body>"), PIPE),
    "many files": (asset("".join(f'<mesh file="{k}.stl"/>' for k in range(400)))
                   + "".join(f'<compiler meshdir="{k}"/>' for k in range(400)), "too many files"),
    "bomb beside an included file": ('<include file="sub/bomb.xml"/>', "20000 elements"),
    "itself": (world('<replicate count="2"><include file="bomb.xml"/></replicate>'), "include"),
    "parts": ('<include file="part0.xml"/>' + '<include file="part1.xml"/>', "together larger"),
    "attached": (asset('<model name="m" file="model.xml"/>')
                 + world('<replicate count="100"><attach model="m" body="b" prefix="p"/>'
                         "</replicate>"), "20000 elements"),
    "unclosed": ("<!--" * 900_000, "not valid MJCF"),
    "quotes": ("<a x='" * 600_000, "not valid MJCF"),
}  # fmt: skip


def write_parts(folder: Path) -> None:
    """What the bombs refer to."""
    (folder / "t.png").write_bytes(PNG)
    with (folder / "m.stl").open("wb") as file:
        file.truncate(ASSET_BYTES + 1)
    for k in range(2):
        (folder / f"part{k}.xml").write_text(f"<mujoco><!-- {'x' * (MJCF_BYTES // 2)} --></mujoco>")
    (folder / "typed.xml").write_text("<!DOCTYPE mujoco><mujoco/>")
    (folder / "model.xml").write_text(f"<mujoco>{world('<site/>' * 300)}</mujoco>")
    (folder / "sub").mkdir()
    os.mkfifo(folder / "sub/pipe")
    (folder / "sub/more.xml").write_text('<mujoco><include file="pipe"/></mujoco>')
    (folder / "sub/bomb.xml").write_text('<mujoco><include file="many.xml"/></mujoco>')
    (folder / "sub/many.xml").write_text(f"<mujoco>{world('<site/>' * 20_001)}</mujoco>")


@pytest.mark.parametrize("what", BOMBS)
def test_a_bomb_is_refused_at_once(tmp_path: Path, what: str) -> None:
    """One line that names the description and the bound, before MuJoCo reserves or makes it."""
    write_parts(tmp_path)
    content, problem = BOMBS[what]
    path = tmp_path / "bomb.xml"
    path.write_text(f"<mujoco>{content}</mujoco>")
    with no_hang(), pytest.raises(ConfigError) as caught:
        read_mjcf(path, ())
    text = str(caught.value)
    assert text.isprintable() and any(word in text for word in problem.split("|")), text


def test_copies_within_the_bounds_are_made(tmp_path: Path) -> None:
    """Replicate, include and attach are counted as MuJoCo makes them."""
    (tmp_path / "part.xml").write_text(f"<mujoco>{world(BODY)}</mujoco>")
    path = tmp_path / "model.xml"
    field = '<asset><hfield name="h" nrow="9" ncol="9" size="1 1 1 1"/></asset>'
    copies = world(f'<replicate count="40">{BODY}</replicate>')
    path.write_text(f'<mujoco><include file="part.xml"/>{field}{copies}</mujoco>')
    model: mujoco.MjModel = read_mjcf(path, ()).compile()
    assert model.nbody == 42 and model.nhfield == 1


def test_mujoco_keeps_less_of_what_it_has_read() -> None:
    """A bound that is lower already stays."""
    cache = mujoco.mj_getCache()
    for before, after in ((500_000_000, KEPT), (1000, 1000), (KEPT, KEPT)):
        mujoco.mj_setCacheCapacity(cache, before)
        load_robot("compact")
        assert mujoco.mj_getCacheCapacity(cache) == after
