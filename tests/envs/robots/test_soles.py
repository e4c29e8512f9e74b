"""Soles from any collision geometry: the polygon on the ground and the plane it lies in."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from poise.configs.errors import ConfigError
from poise.envs.robots.robot import load_robot
from poise.envs.robots.soles import Sole, centroid, simplify
from tests.support.small_biped import BOX_FOOT, LEG, write_biped

RECTANGLE = [[0.1, 0.04], [-0.1, 0.04], [-0.1, -0.04], [0.1, -0.04]]
MESH = "-.1 -.04 -.05  .1 -.04 -.05  .1 .04 -.05  -.1 .04 -.05  0 0 0  .02 0 -.048"


def sphere(x: float, y: float, radius: float = 0.01) -> str:
    return f'<geom size="{radius}" pos="{x} {y} {-0.05 + radius}"/>'


def capsule(y: float) -> str:
    return f'<geom type="capsule" size="0.01" fromto="-0.07 {y} -0.04 0.13 {y} -0.04"/>'


FEET = {
    "box": BOX_FOOT,
    "spheres": "".join(sphere(x, y) for x in (-0.07, 0.13) for y in (-0.04, 0.04)),
    "spheres of two sizes": "".join(
        sphere(x, y, 0.01 if x < 0 else 0.02) for x in (-0.07, 0.13) for y in (-0.04, 0.04)
    ),
    "capsules": capsule(0.04) + capsule(-0.04),
    "mesh": '<geom type="mesh" mesh="sole" pos="0.03 0 0"/>',
    "box with a visual geom below": BOX_FOOT
    + '<geom type="box" size="0.2 0.2 0.01" pos="0 0 -0.1" contype="0" conaffinity="0"/>',
    "box and a small step above it": BOX_FOOT
    + '<geom type="box" size="0.1 0.1 0.001" pos="0.03 0 -0.0435"/>',
    "welded child": f"<body>{BOX_FOOT}</body>",
}


def soles(tmp_path: Path, foot: str, **change: object) -> tuple[Sole, ...]:
    asset = f'<mesh name="sole" vertex="{MESH}"/>'
    return load_robot(write_biped(tmp_path, foot=foot, asset=asset, **change)).soles


@pytest.mark.parametrize("foot", FEET.values(), ids=FEET)
def test_polygon_is_the_rectangle_on_the_ground(tmp_path: Path, foot: str) -> None:
    """Boxes, spheres, capsules and meshes on the same rectangle give the same sole."""
    for sole in soles(tmp_path, foot):
        np.testing.assert_allclose(sole.polygon, RECTANGLE, atol=1e-6)
        np.testing.assert_allclose(sole.position, [0.03, 0, -0.05], atol=1e-6)
        np.testing.assert_allclose(sole.rotation, np.eye(3), atol=1e-6)


def test_points_above_the_plane_do_not_count(tmp_path: Path) -> None:
    """What is higher than 5 mm above the sole plane, such as a toe, is no part of the sole."""
    toe = '<geom type="box" size="0.02 0.02 0.01" pos="0.2 0 -0.03"/>'
    for sole in soles(tmp_path, BOX_FOOT + toe):
        np.testing.assert_allclose(sole.polygon, RECTANGLE, atol=1e-9)
        assert len(sole.geom_ids) == 2


def test_points_near_the_plane_count(tmp_path: Path) -> None:
    """What is up to 5 mm above the sole plane is part of the sole."""
    spheres = "".join(sphere(x, y) for x in (-0.07, 0.13) for y in (-0.04, 0.04))
    toe = '<geom size="0.01" pos="0.2 0 -0.037"/>'
    for sole in soles(tmp_path, spheres + toe):
        assert len(sole.polygon) == 5
        assert np.ptp(sole.polygon[:, 0]) == pytest.approx(0.27)
        assert sole.position[2] == pytest.approx(-0.05, abs=1e-9)


def test_raised_toe_and_heel(tmp_path: Path) -> None:
    """The flat of a sole is found between the slants to raised ends on all sides."""
    ends = "".join(
        f'<geom type="box" size="0.01 0.01 0.01" pos="{x} {y} -0.03"/>'
        for x, y in ((0.22, 0), (-0.15, 0), (0.03, 0.12), (0.03, -0.12))
    )
    for sole in soles(tmp_path, BOX_FOOT + ends):
        np.testing.assert_allclose(sole.polygon, RECTANGLE, atol=1e-9)


def test_named_geoms_only(tmp_path: Path) -> None:
    """With geoms named in the description, the others of the foot do not count."""
    toe = '<geom name="{side}_toe" type="box" size="0.02 0.02 0.01" pos="0.2 0 -0.04"/>'
    feet = [{"name": s, "body": f"{s}_foot", "geoms": [f"{s}_sole"]} for s in ("left", "right")]
    for sole in soles(tmp_path, BOX_FOOT + toe, feet=feet):
        np.testing.assert_allclose(sole.polygon, RECTANGLE, atol=1e-9)
    for sole in soles(tmp_path, BOX_FOOT + toe):
        assert np.ptp(sole.polygon[:, 0]) == pytest.approx(0.29)


def test_round_sole_is_simplified_from_inside(tmp_path: Path) -> None:
    """A disc becomes an octagon on its rim."""
    disc = '<geom type="cylinder" size="0.08 0.01" pos="0.02 0 -0.04"/>'
    for sole in soles(tmp_path, disc):
        assert len(sole.polygon) == 8
        np.testing.assert_allclose(np.linalg.norm(sole.polygon, axis=1), 0.08, atol=1e-9)
        np.testing.assert_allclose(sole.position, [0.02, 0, -0.05], atol=1e-9)


def test_tilted_foot_frame(tmp_path: Path) -> None:
    """The sole's axes are the world's, however the foot body's frame is turned."""
    turned = LEG.replace('_foot" pos="0 0 -0.3"', '_foot" pos="0 0 -0.3" euler="0 0 90"')
    turned = turned.replace('_ankle" axis="0 1 0"', '_ankle" axis="1 0 0"')
    turned = turned.replace('_ankle_roll" axis="1 0 0"', '_ankle_roll" axis="0 -1 0"')
    foot = "".join(sphere(x, y) for x in (-0.04, 0.04) for y in (-0.13, 0.07))
    for sole in soles(tmp_path, foot, leg=turned):
        np.testing.assert_allclose(sole.polygon, RECTANGLE, atol=1e-6)
        np.testing.assert_allclose(sole.position, [0, -0.03, -0.05], atol=1e-6)
        np.testing.assert_allclose(sole.rotation[:, 0], [0, -1, 0], atol=1e-6)


def test_sole_follows_the_heading(tmp_path: Path) -> None:
    """The sole's x axis is the robot's forward, not the foot body's."""
    for sole in soles(tmp_path, BOX_FOOT, forward=[0, 1, 0]):
        np.testing.assert_allclose(sole.rotation[:, 0], [0, 1, 0], atol=1e-9)
        assert np.ptp(sole.polygon[:, 1]) == pytest.approx(0.2)


WRONG = {
    "no collision geometry": '<geom size="0.03" contype="0" conaffinity="0"/>',
    "one ball": '<geom size="0.05"/>',
    "one capsule": capsule(0),
    "an ellipsoid": '<geom type="ellipsoid" size="0.1 0.05 0.03"/>',
    "a knife edge": '<geom type="box" size="0.1 0.001 0.01" pos="0 0 -0.04"/>',
    "tilted by 25°": '<geom type="box" size="0.1 0.04 0.01" pos="0 0 -0.04" euler="0 25 0"/>',
}


@pytest.mark.parametrize("foot", WRONG.values(), ids=WRONG)
def test_feet_without_a_sole(tmp_path: Path, foot: str) -> None:
    """A foot that offers no flat side is refused, with the file and the field."""
    with pytest.raises(ConfigError, match=r"biped\.yaml: feet\[0\]: the foot 'left_foot'"):
        soles(tmp_path, foot)


def test_unknown_geom_lists_those_of_the_foot(tmp_path: Path) -> None:
    """A wrong geom name is answered with the foot's geoms."""
    feet = [{"name": s, "body": f"{s}_foot", "geoms": ["heel"]} for s in ("left", "right")]
    with pytest.raises(ConfigError, match=r"feet\[0\]\.geoms: 'heel'.*choices: left_sole"):
        soles(tmp_path, BOX_FOOT, feet=feet)


def test_centroid() -> None:
    """The centroid is that of the area, wherever the origin is, also with uneven vertices."""
    square = np.array([[0, 0], [2, 0], [2, 1], [2, 2], [0, 2]]) + 5.0
    np.testing.assert_allclose(centroid(square), [6, 6])
    np.testing.assert_allclose(centroid(np.array([[0, 0], [3, 0], [0, 3.0]])), [1, 1])


def test_simplify_keeps_the_corners_that_matter() -> None:
    """Vertices on straight edges go first, then those that cost the least area; none moves."""
    corners = np.array([[1.0, 0], [1, 1], [0, 1], [0, 0]])
    with_middles = np.insert(corners, [1, 2], [[1.0, 0.5], [0.5, 1]], axis=0)
    np.testing.assert_array_equal(simplify(with_middles, 8), corners)
    angles = np.linspace(0, 2 * np.pi, 30, endpoint=False)
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    octagon = simplify(circle, 8)
    assert len(octagon) == 8
    assert all(np.any(np.all(vertex == circle, axis=1)) for vertex in octagon)
    x, y = octagon.T
    area = (x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2
    assert area > 0.85 * np.pi
