"""The robot `human`: a man by de Leva's table, in joints and segments as the seed's body has."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from poise.envs.robots.robot import Robot, load_robot

MASS, STATURE = 73.0, 1.741  # [kg], [m] of the mean man of the table
#: segment → fraction of the mass, length [m], centre of mass from the upper end, radii of gyration
#: about the forward, the left and the long axis, all of them as fractions of the length; males of
#: de Leva (1996), table 4, head and upper trunk from and to the seventh vertebra of the neck
TABLE = {
    "head": (0.0694, 0.2429, 0.5002, (0.303, 0.315, 0.261)),
    "thorax": (0.1596, 0.2421, 0.5066, (0.505, 0.320, 0.465)),
    "abdomen": (0.1633, 0.2155, 0.4502, (0.482, 0.383, 0.468)),
    "pelvis": (0.1117, 0.1457, 0.6115, (0.615, 0.551, 0.587)),
    "upper_arm": (0.0271, 0.2817, 0.5772, (0.285, 0.269, 0.158)),
    "forearm": (0.0162, 0.2689, 0.4574, (0.276, 0.265, 0.121)),
    "hand": (0.0061, 0.0862, 0.7900, (0.628, 0.513, 0.401)),
    "thigh": (0.1416, 0.4222, 0.4095, (0.329, 0.329, 0.149)),
    "shank": (0.0433, 0.4340, 0.4459, (0.255, 0.249, 0.103)),
}
FOOT = (0.0137, 0.2581, 0.4415, (0.124, 0.245, 0.257))  # about its length, the left, upwards
UPWARD = ("head", "thorax", "abdomen", "pelvis")  # bodies whose origin is their lower end


@pytest.fixture(scope="module")
def human() -> Robot:
    return load_robot("human")


def bodies(human: Robot, segment: str) -> list[mujoco.MjModel]:
    """The body of a segment, or of both sides."""
    names = [human.model.body(i).name for i in range(human.model.nbody)]
    return [human.model.body(n) for n in names if n in (segment, f"{segment}_L", f"{segment}_R")]


def test_thirteen_joints_and_thirty_four_degrees_of_freedom(human: Robot) -> None:
    """The root's six among them; a joint of more axes is one."""
    assert human.model.nv == 34 and len(human.joint_names) == 28
    assert len(set(human.model.jnt_bodyid.tolist())) == 13
    assert human.mass == pytest.approx(MASS, abs=0.01)


@pytest.mark.parametrize("segment", TABLE)
def test_segments_are_those_of_the_table(human: Robot, segment: str) -> None:
    fraction, length, below, radii = TABLE[segment]
    found = bodies(human, segment)
    assert len(found) in (1, 2)
    for body in found:
        assert body.mass[0] == pytest.approx(fraction * MASS, rel=1e-3)
        from_origin = length * (1.0 - below) if segment in UPWARD else -length * below
        np.testing.assert_allclose(body.ipos, [0.0, 0.0, from_origin], atol=1e-4)
        _check_inertia(body, fraction * MASS * (np.array(radii) * length) ** 2)


def test_feet_are_those_of_the_table(human: Robot) -> None:
    """As long as the sole; the centre of mass counts from the heel."""
    fraction, length, from_heel, radii = FOOT
    for body, sole in zip(bodies(human, "foot"), human.soles, strict=True):
        assert np.ptp(sole.polygon[:, 0]) == pytest.approx(length, abs=1e-4)
        assert np.ptp(sole.polygon[:, 1]) == pytest.approx(0.055 * STATURE, abs=1e-4)
        heel = sole.position[0] + sole.polygon[:, 0].min()
        assert body.ipos[0] - heel == pytest.approx(from_heel * length, abs=1e-4)
        assert -sole.position[2] == pytest.approx(0.039 * STATURE, abs=1e-4)
        _check_inertia(body, fraction * MASS * (np.array(radii) * length) ** 2)


def _check_inertia(body: mujoco.MjModel, expected: np.ndarray) -> None:
    """Moments about the body's own axes [kg m²]."""
    axes = np.zeros(9)
    mujoco.mju_quat2Mat(axes, body.iquat)
    turned = axes.reshape(3, 3)
    inertia = turned @ np.diag(body.inertia) @ turned.T
    np.testing.assert_allclose(inertia, np.diag(expected), rtol=2e-3, atol=1e-6)


def test_segments_end_where_the_next_begin(human: Robot) -> None:
    lengths = {"shank_L": "thigh", "foot_R": "shank", "forearm_L": "upper_arm", "hand_R": "forearm",
               "abdomen": "pelvis", "thorax": "abdomen", "head": "thorax"}  # fmt: skip
    for body, segment in lengths.items():
        way = np.linalg.norm(human.model.body(body).pos)
        assert way == pytest.approx(TABLE[segment][1], abs=1e-4), body
