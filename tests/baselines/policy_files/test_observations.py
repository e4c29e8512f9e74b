"""baselines/policy_files/observations.py: terms by their meaning, histories by their order."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise.baselines.policy_files.config import ObservationTerm, PolicyFileConfig
from poise.baselines.policy_files.motion.track import MOTION_ALIASES
from poise.baselines.policy_files.observations import Observer
from poise.baselines.policy_files.terms import ALIASES, Seen
from poise.configs.errors import ConfigError
from poise.envs.physics.simulation import Simulation
from tests.support.refused import invalid
from tests.support.shared import generic_state, robot

JOINTS = ["left_hip", "left_knee", "right_hip"]


def seen(**changes: Any) -> Seen:
    """A body that is turned and moves, with three joints of the policy."""
    state = generic_state().state
    given = Seen(
        state, state.q[:3], state.qvel[6:9], np.array([0.1, 0.2, 0.3]), np.array([0.5, -0.5]),
        np.array([1.0, 2.0, 3.0]), np.pi / 6, np.array([np.pi / 6, np.pi]),
    )  # fmt: skip
    return given._replace(**changes)


def observer(*terms: ObservationTerm, **fields: Any) -> Observer:
    config = PolicyFileConfig(observations=terms, **fields)
    return Observer(config, JOINTS, JOINTS[1:], "own.yaml")


def shown(term: ObservationTerm, **changes: Any) -> np.ndarray:
    return observer(term).observe(seen(**changes))[""]


def observed(name: str) -> np.ndarray:
    return shown(ObservationTerm(name))


def test_terms_mean_what_others_call_so() -> None:
    """Velocities and gravity in the root's axes, joints in the policy's order."""
    state = seen().state
    w, x, y, z = state.qpos[3:7]
    turn = Rotation.from_quat([x, y, z, w]).inv()
    _, pitch, roll = turn.inv().as_euler("ZYX")
    upright = Rotation.from_euler("ZYX", [0.0, pitch, roll])
    expected = {
        "base_lin_vel": turn.apply(np.array(state.qvel[:3])),
        "base_ang_vel": state.qvel[3:6],
        "projected_gravity": turn.apply([0.0, 0.0, -1.0]),
        "roll_pitch": turn.inv().as_euler("ZYX")[:0:-1],
        "root_quat": state.qpos[3:7],
        "root_rot_6d": turn.inv().as_matrix()[:, :2].ravel(),
        "root_local_rot_6d": upright.as_matrix()[:, :2].ravel(),
        "root_local_rot_tan_norm": [
            *upright.apply([1.0, 0.0, 0.0]),
            *upright.apply([0.0, 0.0, 1.0]),
        ],
        "velocity_commands": [1.0, 2.0, 3.0],
        "command_lin_vel": [1.0, 2.0],
        "command_ang_vel": [3.0],
        "joint_pos": state.q[:3],
        "joint_pos_rel": state.q[:3] - [0.1, 0.2, 0.3],
        "joint_vel": state.qvel[6:9],
        "last_action": [0.5, -0.5],
        "phase": [0.5, np.sqrt(0.75)],
        "phase_sin": [0.5, 0.0],
        "phase_cos": [np.sqrt(0.75), -1.0],
    }
    for name, value in expected.items():
        np.testing.assert_allclose(observed(name), value, atol=1e-6, err_msg=name)
    for alias, name in ALIASES.items() - MOTION_ALIASES.items():  # of these: test_track.py
        np.testing.assert_array_equal(observed(alias), observed(name))


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("roll_pitch", lambda whole, upright: [-0.3, 0.4]),
        ("root_quat", lambda whole, upright: whole.as_quat()[[3, 0, 1, 2]]),
        ("root_rot_6d", lambda whole, upright: whole.as_matrix()[:, :2].ravel()),
        ("root_local_rot_6d", lambda whole, upright: upright.as_matrix()[:, :2].ravel()),
        (
            "root_local_rot_tan_norm",
            lambda whole, upright: upright.as_matrix()[:, [0, 2]].T.ravel(),
        ),
    ],
)
def test_the_attitude_of_a_body_that_leans(name: str, expected: Any) -> None:
    """Far from upright and turned: the heading counts in some terms, in others it does not."""
    whole = Rotation.from_euler("ZYX", [0.7, 0.4, -0.3])
    qpos = robot().standing_qpos.copy()
    qpos[3:7] = whole.as_quat()[[3, 0, 1, 2]]
    state = Simulation(robot()).reset(qpos, np.zeros(robot().model.nv))
    value = expected(whole, Rotation.from_euler("ZYX", [0.0, 0.4, -0.3]))
    np.testing.assert_allclose(shown(ObservationTerm(name), state=state), value, atol=1e-9)


def test_scale_comes_after_clip() -> None:
    """As in Isaac Lab and mjlab."""
    term = ObservationTerm("command", scale=(1.0, 10.0, 100.0), clip=(-1.5, 1.5))
    np.testing.assert_allclose(shown(term), [1.0, 15.0, 150.0])


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        ({"term": "constant", "values": (1.0, 0.0, -2.0), "scale": 2.0}, [2.0, 0.0, -4.0]),
        ({"term": "velocity_commands", "pick": (2, 0)}, [3.0, 1.0]),
        ({"term": "joint_pos_rel", "joints": ("*_hip",), "scale": 0.0}, [0.0, 0.0]),
        ({"term": "last_action", "joints": ("right_hip",)}, [-0.5]),
        ({"term": "last_action", "scale": {"*_knee": 0.0, "*": 3.0}}, [0.0, -1.5]),
        ({"term": "root_quat", "pick": (1, 2, 3, 0), "scale": 0.0}, [0.0] * 4),
        ({"term": "command", "scale": {"lin_vel_x": 2.0, "ang_vel_yaw": 0.5}}, [2.0, 2.0, 1.5]),
        ({"term": "command", "scale": {"left": 3.0}, "pick": (2, 1)}, [3.0, 6.0]),
        ({"term": "velocity_commands", "at_rest": (7.0, 8.0, 9.0)}, [1.0, 2.0, 3.0]),
        ({"term": "command", "offset": 1.0, "clip": (0.0, 2.5), "scale": 2.0}, [4.0, 5.0, 5.0]),
        ({"term": "command", "offset": (0.1, -0.2), "pick": (2, 0)}, [3.1, 0.8]),
    ],
)
def test_parts_of_terms(fields: dict[str, Any], expected: list[float]) -> None:
    """Constants, places in a term, joints by name, and factors by the joints' names."""
    np.testing.assert_allclose(shown(ObservationTerm(**fields)), expected)


def test_a_term_may_stand_still_while_nothing_is_commanded() -> None:
    """It shows other numbers then, which are clipped and scaled as its own."""
    stand = ObservationTerm("constant", values=(1.0,), at_rest=(0.0,))
    clock = ObservationTerm("phase_cos", at_rest=(-1.0, -1.0), scale=2.0)
    for command, expected in ((np.zeros(3), [0.0, -2.0, -2.0]), (np.ones(3), [1.0, 3**0.5, -2.0])):
        both = observer(stand, clock).observe(seen(command=command))[""]
        np.testing.assert_allclose(both, expected)


def steps(*terms: ObservationTerm, **fields: Any) -> list[list[float]]:
    """What is shown of a command that is 1, 2, 3 (as one number) and an action of 4, 5, 6."""
    watched = observer(*terms, **fields)
    return [
        watched.observe(seen(command=np.full(3, 1.0 + k), action=np.full(2, 4.0 + k)))[""].tolist()
        for k in range(3)
    ]


ONE = {"term": "command", "pick": (0,)}
OTHER = ObservationTerm("action", pick=(0,))


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        ({"history": 2, "newest_first": True}, [[1, 1], [2, 1], [3, 2]]),
        ({"history": 2, "fill": "zeros"}, [[0, 1], [1, 2], [2, 3]]),
        ({"history": 2, "lag": 1, "fill": "zeros"}, [[0, 0], [0, 1], [1, 2]]),
        ({"history": 2, "lag": 1, "newest_first": True}, [[1, 1], [1, 1], [2, 1]]),
    ],
)
def test_histories_of_other_kinds(fields: dict[str, Any], expected: list[list[int]]) -> None:
    """Newest first, without the present, from zeros; places say how old each step is."""
    term = ObservationTerm(**ONE, **fields)
    assert steps(term) == expected
    ages = [place.age for place in observer(term).places()[""]]
    lag = fields.get("lag", 0)
    assert ages == ([lag, lag + 1] if fields.get("newest_first") else [lag + 1, lag])


def test_a_frame_lies_anywhere() -> None:
    """Several terms of a step side by side, between other terms, with a past of their own."""
    frame = ObservationTerm(frame=(ObservationTerm(**ONE), OTHER), history=2, lag=1, fill="zeros")
    assert steps(OTHER, frame, ObservationTerm(**ONE)) == [
        [4, 0, 0, 0, 0, 1], [5, 0, 0, 1, 4, 2], [6, 1, 4, 2, 5, 3]]  # fmt: skip
    watched = observer(OTHER, frame)
    places = [(place.start, place.size, place.age) for place in watched.places()[""]]
    assert places == [(0, 1, 0), (1, 1, 2), (2, 1, 2), (3, 1, 1), (4, 1, 1)]
    assert str(watched) == "5 numbers (action 1, (command 1, action 1) × 2)"


def test_an_input_each() -> None:
    """Inputs of a network show what is said of each."""
    config = PolicyFileConfig(observations={"now": (OTHER,), "past": (ObservationTerm(**ONE),) * 2})
    watched = Observer(config, JOINTS, JOINTS[1:], "own.yaml")
    assert watched.sizes == {"now": 1, "past": 2}
    assert {k: v.tolist() for k, v in watched.observe(seen()).items()} == {
        "now": [0.5], "past": [1.0, 1.0]}  # fmt: skip


@pytest.mark.parametrize(
    ("term", "message"),
    [
        ({"term": "constant"}, ("observations[0].values", "0")),
        ({"term": "phase", "pick": (2,)}, ("observations[0].pick", "2")),
        ({"term": "phase", "joints": ("a",)}, ("observations[0].joints",)),
        (
            {"term": "dof_pos", "joints": ("tail",)},
            ("observations[0].joints", "'tail'", "left_hip"),
        ),
        ({"term": "dof_pos", "scale": {"*_hip": 1.0}}, ("observations[0].scale",)),
        ({"term": "phase", "at_rest": (0.0,)}, ("observations[0].at_rest", "1", "2")),
        ({"term": "command", "offset": (0.1, 0.2)}, ("observations[0].offset", "2", "3")),
        ({"frame": (ObservationTerm("no"),)}, ("observations[0].frame[0].term",)),
    ],
)
def test_what_does_not_fit_a_term(term: dict[str, Any], message: tuple[str, ...]) -> None:
    """The file, the field, the sizes."""
    with invalid(*message):
        observer(ObservationTerm(**term))


def test_a_part_is_a_term_or_a_frame() -> None:
    """Not both, and not neither."""
    for fields in ({}, {"term": "phase", "frame": (OTHER,)}):
        with pytest.raises(ValueError, match="needs a term or a frame of them, and not both"):
            ObservationTerm(**fields)


@pytest.mark.parametrize(
    ("history", "expected"),
    [("term", [[1, 1, 1, 7, 7], [1, 1, 2, 7, 8], [1, 2, 3, 8, 9]]), ("frame", None)],
)
def test_histories(history: str, expected: list[list[float]] | None) -> None:
    """Oldest first; the first observation fills them; a new trial starts anew."""
    watched = observer(
        ObservationTerm("command", history=3),
        ObservationTerm("last_action", history=3 if expected is None else 2),
        history=history,
    )
    for _ in range(2):
        watched.forget()
        rows = [
            watched.observe(seen(command=np.full(3, 1.0 + k), action=np.full(2, 7.0 + k)))[""]
            for k in range(3)
        ]
        if expected is None:
            frames = [[1.0 + k] * 3 + [7.0 + k] * 2 for k in range(3)]
            np.testing.assert_array_equal(rows[0], frames[0] * 3)
            np.testing.assert_array_equal(rows[2], np.concatenate(frames))
        else:
            sizes = np.repeat([True, False], [9, 4])
            for row, values in zip(rows, expected, strict=True):
                np.testing.assert_array_equal(row[sizes], np.repeat(values[:3], 3))
                np.testing.assert_array_equal(row[~sizes], np.repeat(values[3:], 2))
    parts = "(command 3, last_action 2) × 3" if expected is None else "command 3 × 3"
    assert watched.sizes == {"": len(rows[0])} and parts in str(watched)


def test_frames_need_one_length() -> None:
    """Whole steps cannot lie side by side where terms show different numbers of them."""
    with pytest.raises(ConfigError, match=r"own.yaml: observations\[1\].history: 2 .* 3"):
        observer(ObservationTerm("command", history=3), ObservationTerm("action", history=2),
                 history="frame")  # fmt: skip
