"""Push options, and samplers of random pushes."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
from hypothesis import strategies as st

from poise.configs.schema import build
from poise.envs.physics.pushes.options import KICK_KEYS, PUSH_KEYS, parse_pushes
from poise.envs.physics.pushes.sampler import PushSampler
from poise.envs.physics.pushes.table import ROW, pack
from tests.support.shared import robot

from .resets import KICK, PUSH
from .texts import Draw, edit_tree
from .values import Json, decode, values

SAMPLER = {
    "magnitude": [0.5, 1.6], "unit": "specific_impulse", "bodies": ["torso"],
    "duration": [0.05, 0.3], "direction": [0.0, 360.0], "elevation": [0.0, 1.0], "offset": 0.0,
    "profile": "half-sine", "start": [0.5, 0.5], "count": [1, 3], "interval": [1.0, 1.0],
    "no_push": 0.1, "limit_table": {"directions": [0.0, 90.0], "impulses": [10.0, 20.0]},
}  # fmt: skip
UNITS = ("impulse", "force", "specific_impulse", "ankle_fraction", "controller_fraction", "delta_v")


@st.composite
def cases(draw: Draw) -> Json:
    """Pushes as a user writes them, or a sampler's fields."""
    if draw(st.booleans()):
        unit = draw(st.sampled_from(UNITS))
        return {"sampler": edit_tree(draw, {**SAMPLER, "unit": unit})}
    how = draw(st.integers(0, 2))
    if how == 0:
        return {"push": draw(values([*PUSH_KEYS, *KICK_KEYS]))}
    good = draw(st.sampled_from([PUSH, KICK, [PUSH, KICK]]))
    if how == 1 or isinstance(good, list):
        return {"push": edit_tree(draw, good)}
    return {"push": {**good, draw(st.sampled_from(PUSH_KEYS)): draw(values())}}


def play(case: Json, folder: Path) -> None:
    """Parse or sample, and describe them to the simulator, which takes finite numbers only."""
    if "push" in case:
        pushes = parse_pushes(decode(case["push"]), robot(), lambda direction: 0.1)
    else:
        fields = decode(case["sampler"])
        sampler = build(PushSampler, fields, "sampler")
        sampler = dataclasses.replace(sampler, count=(1, min(sampler.count[1], 3)))
        pushes = sampler.sample(np.random.default_rng(0), robot(), lambda direction: 0.1)
    assert all(np.isfinite(pack(pushes, robot(), 0.0)[name]).all() for name in ROW.names), (
        "a push that is not finite"
    )
