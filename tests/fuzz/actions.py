"""Actions, and the order of calls."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st

from poise.configs.errors import PoiseError

from .texts import Draw
from .values import Json, decode, values
from .worlds import CLASSES, world, worlds

SIZES = {"torque": 21, "residual": 4, "step": None, "vector": 21}


@st.composite
def _actions(draw: Draw, size: int, rows: int) -> Json:
    if draw(st.integers(0, 2)) == 0:
        return draw(values())
    numbers = st.one_of(st.floats(-1.0, 1.0), st.sampled_from([1.0, -1.0, 0.0]))
    row = draw(st.lists(numbers, min_size=size, max_size=size))
    if draw(st.integers(0, 2)) == 0:
        row[draw(st.integers(0, size - 1))] = draw(values())
    return [row] * rows if rows else row


@st.composite
def cases(draw: Draw) -> Json:
    """Which environment, whether it is reset before, one to four actions."""
    name = draw(st.sampled_from([*CLASSES, "vector"]))
    size = worlds().envs[0].action_space.shape[0] if name == "vector" else (
        world(name).action_space.shape[0]
    )  # fmt: skip
    rows = 2 if name == "vector" else 0
    actions = draw(st.lists(_actions(size, rows), min_size=1, max_size=4))
    return {"env": name, "reset": draw(st.integers(0, 3)) > 0, "actions": actions}


def play(case: Json, folder: Path) -> None:
    """Every action is taken or refused; a refused one moves nothing."""
    env: Any = worlds() if case["env"] == "vector" else world(case["env"])
    if case["reset"]:
        env.reset(seed=0)
    for action in case["actions"]:
        before = _positions(env)
        try:
            observation = env.step(decode(action))[0]
        except PoiseError as error:
            assert np.array_equal(before, _positions(env)), "a refused action moved something"
            assert "\n" not in str(error), "an error of several lines"
        else:
            assert np.isfinite(observation).all() and np.abs(observation).max() <= 10.0


def _positions(env: Any) -> np.ndarray:
    envs = getattr(env, "envs", [env])
    return np.concatenate([each.simulation.data.qpos for each in envs])
