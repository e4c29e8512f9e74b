"""sessions: a session is a trial, bit for bit, and pushes meet all sides alike."""

from __future__ import annotations

from functools import partial

import mujoco
import numpy as np
import pytest

from poise.baselines.balance.references.motion import load_motion
from poise.baselines.walking.planner.command import GaitCommand
from poise.baselines.walking.schedule import TimedCommand, parse_commands
from poise.configs.errors import ConfigError
from poise.envs.balance.base import BalanceEnv
from poise.envs.physics.pushes.push import Push
from poise.training.benchmarking.trials.agents import load_agent
from poise.training.benchmarking.trials.play import run_trial
from poise.training.benchmarking.trials.trial import Trial
from poise.training.pictures.sessions.frames import VALUES, Frame, frame_between
from poise.training.pictures.sessions.live import KEPT, Live
from poise.training.pictures.sessions.loading import read_mapping
from poise.training.pictures.sessions.session import Session, load_session
from poise.training.pictures.sessions.spec import SessionSpec
from tests.support.refused import invalid
from tests.support.shared import robot

NAMES = ["momentum-qp", "feedback-step"]
SMALL = {"impulse": 12.0, "direction": 70.0, "duration": 0.1, "body": "torso"}
LARGE = {"impulse": 60.0, "direction": 0.0, "duration": 0.1, "body": "torso"}


@pytest.fixture(scope="module")
def session() -> Session:
    return load_session(NAMES, robot(), seed=3)


def state(env: BalanceEnv) -> np.ndarray:
    return np.concatenate([env.data.qpos, env.data.qvel, env.simulation.views.ctrl])


def played(name: str, trial: Trial, seconds: float) -> list[np.ndarray]:
    """The states of a trial in an evaluation, whose environments end by time."""
    agent = load_agent(name, robot(), duration=seconds, pushes=None)
    states: list[np.ndarray] = []
    run_trial(agent, trial, lambda env: states.append(state(env)))
    return states


@pytest.mark.parametrize("pushed", [False, True])
def test_a_session_is_its_trial_bit_for_bit(session: Session, pushed: bool) -> None:
    """What an evaluation plays of the same start and pushes, in every state, though the session's
    pushes came while it ran: more of them than the table of pushes has rows at first."""
    session.reset()
    seen = [[state(side.env)] for side in session.sides]
    for step in range(100):
        if pushed and step in (10, 25, 26, 40, 60):
            session.push(**{**SMALL, "impulse": 3.0 + 0.1 * step, "direction": 3.0 * step})
        session.step()
        for states, side in zip(seen, session.sides, strict=True):
            states.append(state(side.env))
    assert len(session.trial.pushes) == (5 if pushed else 0)
    for name, states in zip(NAMES, seen, strict=True):
        again = played(name, session.trial, 2.0)
        assert len(again) == 101
        assert all(map(partial(np.array_equal), states, again)), name


def test_all_sides_meet_the_same_push(session: Session) -> None:
    """Its time, force and point are the same in every robot's table."""
    session.reset()
    for _ in range(5):
        session.step()
    push = session.push(**SMALL, point=[0.0, 0.0, 0.1])
    assert push == Push("torso", 0.1, 0.1, 12.0, 70.0, point=(0.0, 0.0, 0.1))
    tables = [side.env.simulation.push_table for side in session.sides]
    assert np.array_equal(*tables) and np.count_nonzero(tables[0]["duration"]) == 1


def test_directions_are_those_of_the_start(session: Session) -> None:
    """A push counts from the heading at the reset, as in a trial, not from that of the moment."""
    session.reset()
    session.step()
    simulation = session.sides[0].env.simulation
    simulation.state_arrays.heading[:] = [0.0, 1.0]  # as if it had turned by 90°
    session.push(**{**SMALL, "direction": 0.0})
    force = simulation.push_table["force"][0]
    assert force @ [np.cos(simulation.start_yaw), np.sin(simulation.start_yaw), 0.0] > 100.0


def test_a_reset_forgets_pushes_from_outside_alone(session: Session) -> None:
    """Those that were scheduled come again."""
    known = Push("torso", 0.1, 0.1, 8.0, 0.0)
    scheduled = Session([side.agent for side in session.sides], 0, [known])
    scheduled.step()
    scheduled.push(**SMALL)
    assert len(scheduled.pushes) == 2
    scheduled.reset()
    assert scheduled.trial == Trial(0, 0, (known,))
    assert scheduled.sides[1].env.simulation.pushes == (known,)


def test_after_a_fall_the_motors_are_off(session: Session) -> None:
    """The one that falls says when, lies down, and does not hold up the other."""
    session.reset()
    session.push(**{**LARGE, "impulse": 26.0})
    for _ in range(150):
        session.step()
    fallen, other = session.sides
    assert fallen.fall_time is not None and 0.2 < fallen.fall_time < 2.9
    assert other.fall_time is None and other.time == fallen.time == pytest.approx(3.0)
    assert not fallen.env.simulation.views.ctrl.any() and other.env.simulation.views.ctrl.any()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"body": "tail"}, ("body", "'tail'")),
        ({"impulse": -1.0}, ("impulse",)),
        ({"impulse": float("nan")}, ("impulse",)),
        ({"duration": 0.0}, ("duration",)),
    ],
)
def test_a_wrong_push_is_refused(session: Session, change: dict, message: tuple[str, ...]) -> None:
    session.reset()
    with invalid(*message):
        session.push(**{**SMALL, **change})
    assert session.pushes == ()


def test_frames_tell_what_the_state_is(session: Session) -> None:
    """Poses, and the values that are plotted."""
    session.reset()
    live = Live(session)
    live.push(**SMALL)
    live.step()
    frame, simulation = live.history[live.at][0], session.sides[0].env.simulation
    assert isinstance(frame, Frame) and frame.time == simulation.time == pytest.approx(0.02)
    assert np.array_equal(frame.positions, simulation.data.xpos)
    assert set(frame.values) == set(VALUES)
    assert frame.values["push"] == pytest.approx(120.0)
    assert frame.values["speed"] == np.linalg.norm(simulation.state.com_vel)
    state = simulation.state
    assert frame.values["margin"] == state.support_distance(state.capture_point)
    names = {mark.name for mark in frame.marks}
    assert names >= {"com", "cop", "capture point", "support", "push", "contact force"}


def test_slow_motion_is_between_two_frames(session: Session) -> None:
    """Half of the way and half of the turn, the shorter way around; the ends are the frames."""
    live = Live(session)
    live.reset()
    live.push(**LARGE)
    for _ in range(10):
        live.step()
    first, second = live.history[-2][0], live.history[-1][0]
    other = first._replace(quaternions=-first.quaternions)  # the same turns
    for start in (first, other):
        middle = frame_between(start, second, 0.5)
        assert np.allclose(middle.positions, 0.5 * (first.positions + second.positions))
        cosines = [np.sum(middle.quaternions * f.quaternions, axis=1) for f in (first, second)]
        assert np.allclose(np.abs(cosines[0]), np.abs(cosines[1])) and np.min(cosines[1]) > 0.98
        assert np.allclose(np.linalg.norm(middle.quaternions, axis=1), 1.0)
    assert np.allclose(frame_between(first, second, 0.0).positions, first.positions)
    assert np.array_equal(frame_between(first, second, 1.0).quaternions.round(12),
                          second.quaternions.round(12))  # fmt: skip


def test_what_is_seen_changes_nothing(session: Session) -> None:
    """With frames and without, the states are the same bits."""
    session.reset()
    for _ in range(20):
        session.step()
    expected = [state(side.env) for side in session.sides]
    session.reset()
    live = Live(session)
    for _ in range(20):
        live.step()
    assert all(
        np.array_equal(state(side.env), other)
        for side, other in zip(session.sides, expected, strict=True)
    )


def test_a_planned_foothold_is_marked(session: Session) -> None:
    """Only of the controller that steps, only while a foot swings."""
    live = Live(session)
    live.reset()
    live.push(**{**LARGE, "impulse": 22.0})
    counts = np.zeros(2, dtype=int)
    for _ in range(60):
        live.step()
        counts += [
            sum(mark.name == "foothold" for mark in frame.marks) for frame in live.history[-1]
        ]
    assert counts[0] == 0 and 5 < counts[1] < 60


def test_the_last_seconds_are_kept(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    """A session that goes on does not grow; what is shown is the present."""
    assert KEPT >= 10.0
    monkeypatch.setattr("poise.training.pictures.sessions.live.KEPT", 0.2)
    live = Live(session)
    live.reset()
    for _ in range(25):
        live.step()
    assert len(live.history) == 10 and live.at == 9
    assert live.history[-1][0].time == pytest.approx(0.5)
    live.reset()
    assert len(live.history) == 1 and live.at == 0


def test_the_command_plays_the_same_again(session: Session) -> None:
    """Its flags have every digit of the pushes that came."""
    live = Live(session, SessionSpec(("a",), seed=3))
    live.reset()
    live.step()
    live.push(**SMALL, point=[0.1, 0.0, -0.25])
    assert live.spec.command == (
        "poise view a --robot humanoid --seed 3 --push '{impulse: 12.0, direction: 70.0, "
        "duration: 0.1, body: torso, start: 0.02, point: [0.1, 0.0, -0.25]}'"
    )


@pytest.fixture(scope="module")
def walk() -> Session:
    return load_session(["walk", "zero"], robot(), seed=5)


def test_a_walk_is_its_trial_bit_for_bit(walk: Session) -> None:
    """Commands that came while it ran are those of the trial, and so are the commands in text."""
    walk.reset()
    live, seen = Live(walk), [state(walk.sides[0].env)]
    for step in range(150):
        if step in (10, 60, 110):
            live.walk(ahead=0.003 * step, left=0.1, turn=-0.0015 * step)
        live.step()
        seen.append(state(walk.sides[0].env))
    assert walk.command.ahead == 0.33 and len(walk.trial.commands) == 3
    again = played("walk", walk.trial, 3.0)
    assert len(again) == 151 and all(map(partial(np.array_equal), seen, again))
    texts = [read_mapping(text, "command") for text in live.spec.commands]
    assert parse_commands(texts) == walk.trial.commands


def test_a_command_takes_the_place_of_what_was_planned(walk: Session) -> None:
    """One at the same moment takes the place of the other; a reset brings the plan back."""
    planned = (TimedCommand(ahead=0.2), TimedCommand(ahead=0.4, start=1.0))
    session = Session([walk.sides[0].agent], 5, (), planned)
    assert session.command == planned[0]
    session.step()
    session.walk(ahead=0.5)
    session.walk(ahead=0.6)
    assert session.commands == (planned[0], TimedCommand(ahead=0.6, start=0.02))
    assert session.sides[0].walker.command.ahead == 0.6
    session.reset()
    assert session.commands == planned and session.sides[0].walker.command.ahead == 0.2


def test_a_command_out_of_reach_leaves_the_one_that_holds(walk: Session) -> None:
    """In the session and its trial, too, so that what it saves is what was played."""
    walk.reset()
    walk.walk(ahead=0.3, width=0.25)
    walk.step()
    held, trial = walk.command, walk.trial
    for wrong in ({"width": 2.0}, {"ahead": 0.3, "clearance": 0.5}, {"ahead": 9.0}):
        with pytest.raises(ConfigError, match="is out of range: 'humanoid' supports"):
            walk.walk(**wrong)
    assert walk.command == held and walk.trial == trial
    walker = walk.sides[0].walker
    assert walker is not None and walker.command == GaitCommand(0.3, width=0.25)


def test_what_does_not_walk_takes_no_command(session: Session, walk: Session) -> None:
    """Beside one that walks it stands; alone it refuses, and names those that do."""
    assert walk.walks and not session.walks
    message = "command: none of these controllers walks.*walk"
    with pytest.raises(ConfigError, match=message):
        session.walk(ahead=0.5)
    with pytest.raises(ConfigError, match=message):
        Session([walk.sides[1].agent], commands=[TimedCommand(0.5)])
    with pytest.raises(ConfigError, match="ahead"):
        walk.walk(ahead=float("nan"))


def test_the_ghost_is_the_reference() -> None:
    """Trunk and arms are the motion's, and its soles stand where the robot's stood at the reset."""
    motion = load_motion("squat", robot())
    session = load_session(["momentum-qp"], robot(), seed=1, motion=motion)
    live, env = Live(session), session.sides[0].env
    state = env.simulation.state
    soles, axes = state.sole_points.copy(), state.sole_axes.copy()
    for _ in range(60):
        live.step()
    frame = live.history[-1][0]
    assert frame.ghost is not None
    model, data = robot().model, mujoco.MjData(robot().model)
    data.qpos[:3], data.qpos[3:7] = frame.ghost.positions[1], frame.ghost.quaternions[1]
    data.qpos[7:] = motion.sample(frame.time).q_ref
    mujoco.mj_kinematics(model, data)
    legs = {sole.body_id for sole in robot().soles}
    for _ in range(model.nbody):
        legs |= {int(model.body_parentid[body]) for body in legs} - {0, robot().root_body_id}
    others = [body for body in range(1, model.nbody) if body not in legs]
    assert len(others) == 5  # trunk and arms
    assert np.allclose(data.xpos[others], frame.ghost.positions[others], atol=1e-9)
    turns = np.abs(np.sum(data.xquat * frame.ghost.quaternions, axis=1))
    assert np.allclose(turns[others], 1.0)
    for sole, place, wanted in zip(robot().soles, soles, axes, strict=True):
        quat, found = frame.ghost.quaternions[sole.body_id], np.zeros(9)
        mujoco.mju_quat2Mat(found, quat)
        turn = found.reshape(3, 3)
        point = frame.ghost.positions[sole.body_id] + turn @ sole.position
        assert np.allclose(point, place, atol=1e-4)
        assert np.allclose(turn @ sole.rotation, wanted, atol=1e-4)
    apart = np.linalg.norm(frame.positions - frame.ghost.positions, axis=1)[1:]
    assert 1e-4 < apart.max() < 0.06  # it is followed, not copied
    between_two = frame_between(live.history[-2][0], frame, 0.5).ghost
    before = live.history[-2][0].ghost
    assert np.allclose(2.0 * between_two.positions, before.positions + frame.ghost.positions)
