"""`reset`: seeds and options."""

from __future__ import annotations

from pathlib import Path

from hypothesis import strategies as st

from poise.envs.balance.start import RESET_OPTIONS
from poise.envs.physics.pushes.options import KICK_KEYS, PUSH_KEYS
from tests.support.shared import robot

from .texts import Draw, edit_tree
from .values import Json, decode, values
from .worlds import CLASSES, play_on, world, worlds

PUSH = {"impulse": 12.0, "direction": 90.0, "duration": 0.1, "start": 0.01, "body": "torso"}
KICK = {"delta_v": 0.3, "start": 0.01, "direction": 45.0}
KEYS = (*RESET_OPTIONS, *PUSH_KEYS, *KICK_KEYS, "reset_mask")


@st.composite
def _options(draw: Draw) -> Json:
    """Good options with some values in the place of others, or anything."""
    if draw(st.integers(0, 3)) == 0:
        return draw(values(KEYS))
    model = robot().model
    good = {
        "push": draw(st.sampled_from([PUSH, [PUSH, KICK], []])),
        "noise": 1.0,
        "qpos": robot().standing_qpos.tolist(),
        "qvel": [0.0] * model.nv,
        "fallen": 3,
        "realism": {},
    }
    kept = draw(st.lists(st.sampled_from(RESET_OPTIONS), unique=True, min_size=1))
    if draw(st.booleans()):
        return edit_tree(draw, {name: good[name] for name in kept})
    return {name: draw(values(KEYS)) if draw(st.booleans()) else good[name] for name in kept}


@st.composite
def cases(draw: Draw) -> Json:
    """Which environment, its seed, its options."""
    seed = draw(st.one_of(st.integers(0, 9), values()))
    return {"env": draw(st.sampled_from([*CLASSES, "vector"])), "seed": seed,
            "options": draw(_options())}  # fmt: skip


def play(case: Json, folder: Path) -> None:
    """Reset, and take two steps."""
    seed, options = decode(case["seed"]), decode(case["options"])
    if case["env"] == "vector":
        vector = worlds()
        vector.reset(seed=seed, options=options)
        for env in vector.envs:
            play_on(env, env.episode.observation.astype("float32"))
        return
    env = world(case["env"])
    play_on(env, env.reset(seed=seed, options=options)[0])
