"""Pushes from dictionaries: what is set, in which units, and what is refused."""

import copy
from dataclasses import replace

import numpy as np
import pytest

from poise.configs.errors import ConfigError
from poise.envs.compiled.maths.pendulum import ankle_limit
from poise.envs.physics.pushes.options import body_names, parse_pushes, to_impulse
from poise.envs.physics.pushes.push import Kick, Push
from poise.envs.robots.robot import load_robot


@pytest.fixture(scope="module")
def robot():
    return load_robot("humanoid")


def test_a_dictionary_sets_exactly_one_square_push(robot):
    """The push of the documentation is what the environment gets."""
    options = {"impulse": 12.0, "direction": 90.0, "duration": 0.1, "start": 0.5, "body": "torso"}
    assert parse_pushes(options, robot) == (Push("torso", 0.5, 0.1, 12.0, 90.0),)


def test_a_list_sets_several_and_an_empty_list_none(robot):
    """Lists mix dictionaries, pushes and kicks; [] means no push."""
    push = Push("torso", 0.5, 0.1, 12.0, 90.0)
    parsed = parse_pushes([{"impulse": 3}, push, {"delta_v": 0.3, "start": 1.0}], robot)
    root = robot.model.body(robot.root_body_id).name
    assert parsed == (Push(root, 0.0, 0.1, 3.0, 0.0), push, Kick(1.0, 0.3, 0.0))
    assert parse_pushes([], robot) == ()


def test_numpy_values_are_accepted(robot):
    """NumPy scalars and arrays stand for plain numbers."""
    options = {"impulse": np.float32(3.0), "direction": np.int64(90), "point": np.zeros(3)}
    (push,) = parse_pushes(options, robot)
    assert push.impulse == 3.0 and push.direction == 90.0 and push.point == (0.0, 0.0, 0.0)


def test_units_of_the_magnitude(robot):
    """Each unit gives the impulse of its definition."""
    args = {"robot": robot, "direction": 90.0, "duration": 0.2, "profile": "square"}
    half_sine = {**args, "profile": "half-sine"}
    assert to_impulse("impulse", 7.0, **args) == 7.0
    assert to_impulse("force", 50.0, **args) == pytest.approx(10.0)
    assert to_impulse("specific_impulse", 0.4, **args) == pytest.approx(0.4 * robot.mass)
    force_push = Push("torso", 0.0, 0.2, to_impulse("force", 50.0, **half_sine), 90.0)
    assert Push(**{**vars(force_push), "profile": "half-sine"}).peak_force == pytest.approx(50.0)
    limit = robot.mass * ankle_limit(robot.omega, 0.12, 0.2)
    margin = {90.0: 0.12}.__getitem__  # asks for the push's own direction
    assert to_impulse("ankle_fraction", 0.5, **args, margin=margin) == pytest.approx(0.5 * limit)
    (push,) = parse_pushes(
        {"ankle_fraction": 0.5, "direction": 90.0, "duration": 0.2}, robot, margin
    )
    assert push.impulse == pytest.approx(0.5 * limit)


def test_only_the_bodies_of_the_robot_can_be_pushed(robot):
    """The world is not a choice, every body of the robot's tree is."""
    names = body_names(robot)
    assert "world" not in names and len(names) == robot.model.nbody - 1


@pytest.mark.parametrize(
    ("value", "named"),
    [
        ({"impulse": 1.0, "colour": 1}, ("colour", "impulse", "ankle_fraction", "direction")),
        ({"impulse": 1.0, "body": "tail"}, ("tail", "body", "torso")),
        ({"impulse": 1.0, "body": 3}, ("body",)),
        ({"impulse": 1.0, "body": "world"}, ("body", "torso")),
        ({"impulse": float("nan")}, ("impulse", "finite")),
        ({"impulse": -1.0}, ("impulse", "-1.0")),
        ({"impulse": "12"}, ("impulse", "12")),
        ({"impulse": True}, ("impulse",)),
        ({"impulse": 1.0, "duration": 0.0}, ("duration",)),
        ({"impulse": 1.0, "duration": float("inf")}, ("duration",)),
        ({"impulse": 1.0, "start": -0.1}, ("start",)),
        ({"impulse": 1.0, "direction": 361.0}, ("direction",)),
        ({"impulse": 1.0, "elevation": 91.0}, ("elevation",)),
        ({"impulse": 1.0, "point": [0.0, 1.0]}, ("point",)),
        ({"impulse": 1.0, "profile": "triangle"}, ("profile", "half-sine")),
        ({"direction": 0.0}, ("magnitude", "specific_impulse")),
        ({"impulse": 1.0, "force": 2.0}, ("magnitude", "impulse and force")),
        ({"ankle_fraction": 1.0}, ("ankle_fraction", "margin")),
        ({"delta_v": 1.0, "body": "torso"}, ("body", "delta_v", "start")),
        ({"delta_v": float("inf")}, ("delta_v",)),
        (Push("torso", 0.0, 0.1, float("nan"), 0.0), ("impulse",)),
        (Push("tail", 0.0, 0.1, 1.0, 0.0), ("tail", "torso")),
        ([{"impulse": 1.0}, {"impulse": None}], ("push[1]", "impulse")),
        ([3], ("push[0]",)),
        ("hard", ("push", "mapping")),
        (None, ("push", "mapping")),
    ],
)
def test_bad_pushes_are_refused(robot, value, named):
    """One error, naming the field, the value and the choices."""
    with pytest.raises(ConfigError) as error:
        parse_pushes(value, robot)
    for word in ("push", *named):
        assert word in str(error.value)


def test_ankle_fraction_uses_gravity_and_height(robot):
    """ω = √(g/z_c) comes from the robot, not from a constant."""
    model = copy.copy(robot.model)
    model.opt.gravity[2] = -1.6
    moon = replace(robot, model=model, height_com=0.4)
    assert moon.omega == pytest.approx(2.0)
    assert moon.units.force == pytest.approx(1.6 * robot.mass)
    assert moon.units.moment == pytest.approx(0.64 * robot.mass)
