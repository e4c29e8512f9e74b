"""Every kind of constraint: its rows' derivatives, its bounds, and what counts as violated."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from poise.baselines.motion.space_time.constraints.constraint import Constraint, violation
from poise.baselines.motion.space_time.constraints.heading import Heading
from poise.baselines.motion.space_time.constraints.points import (
    Apart,
    Height,
    Keep,
    OverSupport,
    PointReach,
    Speed,
)
from poise.baselines.motion.space_time.constraints.scene import ConstraintRows, Scene
from poise.baselines.motion.space_time.constraints.touch import Touch
from tests.support.scenes import swaying

ALL = (
    Keep(point="hand_left"),
    Keep(point="hand_right", to="chest", within=0.01),
    PointReach(point="hand_left", place=(0.3, None, 1.2)),
    PointReach(point="com", place=(0.0, 0.0, 0.9), to="feet"),
    OverSupport(margin=0.03),
    Height(point="pelvis", least=0.6, most=0.7),
    Speed(point="elbow_right", most=0.2),
    Heading(angle=20.0),
    Heading(angle=-10.0, of="shoulders", within=2.0),
    Apart(point="hand_left", to="hand_right", distance=0.6),
    Touch(point="hand_left", body="pelvis"),
)


def rows_at(constraint: Constraint, scene: Scene, frame: int) -> list[ConstraintRows]:
    return list(constraint.rows(scene, [frame]))


def test_every_kind_is_here() -> None:
    assert {each.kind for each in ALL} == set(Constraint.kinds())


@pytest.mark.parametrize("constraint", ALL, ids=lambda each: each.about())
def test_rows_are_derivatives_on_the_manifold(constraint: Constraint) -> None:
    """Central differences of every row by the postures of its frames.

    A row of Keep is relative to a place, which does not count: it moves with its postures here,
    by half of them or not at all, so the difference of two of its frames is compared.
    """
    scene, rng, h, frame = swaying(), np.random.default_rng(0), 1e-6, 12
    rows = rows_at(constraint, scene, frame)
    assert rows
    for f in rows[0].parts:
        way, values = rng.normal(size=scene.model.nv), []
        start = scene.qpos.copy()
        for sign in (1.0, -1.0):
            scene.move(start.copy())
            scene.displace(f, sign * h * way)
            now = np.concatenate([each.value for each in rows_at(constraint, scene, frame)])
            if rows[0].shared:
                now = now - np.concatenate([r.value for r in rows_at(constraint, scene, 8)])
            values.append(now)
        scene.move(start)
        numeric = (values[0] - values[1]) / (2.0 * h)
        exact = np.concatenate([each.parts[f] @ way for each in rows])
        assert numeric == pytest.approx(exact, abs=2e-6)


def test_violations_in_their_units() -> None:
    """Against what is asked for computed beside it; within the bounds nothing is missed."""
    scene = swaying()
    inside = range(6, len(scene) - 6)
    hands = [
        [scene.limbs.points[f"hand_{side}"].place(scene.at(f)) for side in ("left", "right")]
        for f in inside
    ]
    left = np.array([pair[0] for pair in hands])
    missed = violation(PointReach(point="hand_left", place=(None, None, 1.2), within=0.01), scene)
    assert missed.largest == pytest.approx(np.abs(left[:, 2] - 1.2).max() - 0.01)
    assert missed.unit == "m" and not missed.holds
    assert scene.times[inside[int(np.abs(left[:, 2] - 1.2).argmax())]] == missed.time
    kept = violation(Keep(point="hand_left"), scene)
    assert kept.largest == pytest.approx(0.5 * np.ptp(left, axis=0).max())
    before = scene.limbs.points["hand_left"].place(scene.at(5))
    speeds = np.linalg.norm(np.diff([before, *left], axis=0), axis=1) / scene.dt
    fast = violation(Speed(point="hand_left", most=0.1), scene)
    assert fast.largest == pytest.approx(speeds.max() - 0.1) and fast.unit == "m/s"
    slow = violation(Speed(point="hand_left", most=float(speeds.max()) + 0.001), scene)
    assert slow.largest == 0.0 and slow.holds
    gaps = np.array([np.linalg.norm(a - b) for a, b in hands])
    near = violation(Apart(point="hand_left", to="hand_right", distance=2.0), scene)
    assert near.largest == pytest.approx(2.0 - gaps.min())


def test_heading_is_where_the_body_faces() -> None:
    """Standing faces 0°; turned by 30° to the left about the vertical axis, 30°."""
    scene = swaying(size=0.0)
    assert violation(Heading(angle=0.0), scene).largest == pytest.approx(0.0, abs=1e-9)
    for frame in range(len(scene)):
        scene.displace(frame, np.array([0, 0, 0, 0, 0, np.radians(30.0)] + [0] * 21, dtype=float))
    turned = violation(Heading(angle=10.0), scene)
    assert turned.largest == pytest.approx(20.0, abs=1e-6) and turned.unit == "°"


def test_the_support_is_the_hull_of_the_planted_soles() -> None:
    """Standing is inside; a CoM that is moved out is outside by as much; one sole is a smaller
    support than both."""
    scene = swaying(size=0.0)
    assert violation(OverSupport(margin=0.0), scene).holds
    corners = scene.planted_corners[0].reshape(-1, 3)
    point = scene.point("com", "point")
    ahead = corners[:, 0].max() - point.place(scene.at(0))[0]
    over = violation(OverSupport(margin=float(ahead) + 0.05), scene)
    assert over.largest >= 0.05 - 1e-9  # some side is as near as the front, or nearer
    scene.planted[:, scene.sides["left"]] = False
    alone = violation(OverSupport(margin=0.0), scene)
    inner = corners[corners[:, 1] < 0.0, 1].max()
    assert alone.largest == pytest.approx(point.place(scene.at(0))[1] - inner, abs=1e-6)


def test_touch_is_the_gap_between_surfaces() -> None:
    """The hand is a sphere and what it may touch a capsule: c to the segment, less both radii."""
    scene = swaying(size=0.0)
    touch = Touch(point="hand_left", body="pelvis")
    model, data = scene.model, scene.at(10)
    hand, (hip,) = touch.geoms(scene)
    assert model.geom_type[hand] == mujoco.mjtGeom.mjGEOM_SPHERE
    assert model.geom_type[hip] == mujoco.mjtGeom.mjGEOM_CAPSULE
    way = data.geom_xpos[hand] - data.geom_xpos[hip]
    axis, half = data.geom_xmat[hip].reshape(3, 3)[:, 2], model.geom_size[hip, 1]
    gap = np.linalg.norm(way - np.clip(way @ axis, -half, half) * axis)
    gap -= model.geom_size[hand, 0] + model.geom_size[hip, 0]
    assert rows_at(touch, scene, 10)[0].value[0] == pytest.approx(gap, abs=1e-6)
    for _ in range(3):
        now = rows_at(touch, scene, 10)[0]
        gradient = now.parts[10][0]
        scene.displace(10, -0.9 * now.value[0] * gradient / (gradient @ gradient))
    assert 0.0 < rows_at(touch, scene, 10)[0].value[0] < 0.01
