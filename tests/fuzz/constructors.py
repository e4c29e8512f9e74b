"""What makes environments: arguments of the classes, of many at once, of an EnvConfig."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hypothesis import strategies as st

from poise.configs.schema import to_dict
from poise.envs.balance.config import EnvConfig
from poise.envs.balance.vector.vector_env import make_vector_env
from tests.support.shared import robot

from .texts import Draw, edit_tree
from .values import Json, decode, values
from .worlds import CLASSES, play_on

CONFIG = to_dict(EnvConfig())
GOOD: dict[str, Json] = {
    **CONFIG,
    "robot": "humanoid",
    "config": CONFIG,
    "render_mode": "rgb_array",
    "controller": "momentum-qp",
    "motion": "squat",
    "residual": {"com": 0.1, "cop": 0.1},
    "smoothing": 0.1,
    "gate": 0.05,
}
VECTOR = {"num_envs": 2, "threads": 1, "autoreset_mode": "SameStep"}
FIELDS = [*EnvConfig.__dataclass_fields__, "magnitude", "unit", "joints", "kind", "height"]


@st.composite
def cases(draw: Draw) -> Json:
    """A class, some arguments, and whether many are made at once."""
    known = {name: good for name, good in GOOD.items() if name != "robot"}
    names = draw(st.lists(st.sampled_from([*known, "robot"]), unique=True, max_size=3))
    arguments = {name: GOOD[name] for name in names}
    many = draw(st.integers(0, 3)) == 0
    if many:
        arguments |= VECTOR
    wrong = draw(st.sampled_from([*arguments, "noise", "duration", "nosuch"]))
    if draw(st.booleans()) and isinstance(arguments.get(wrong), dict):
        arguments[wrong] = edit_tree(draw, arguments[wrong])
    else:
        arguments[wrong] = draw(values(FIELDS))
    return {"env": draw(st.sampled_from(sorted(CLASSES))), "many": many, "arguments": arguments}


def play(case: Json, folder: Path) -> None:
    """Make it, reset it, take a step. A window is not opened, and no more than three are made."""
    arguments: dict[str, Any] = {"robot": robot(), **decode(case["arguments"])}
    mode = arguments.get("render_mode")
    if isinstance(mode, str) and mode == "human":
        return
    if case["many"]:
        count = arguments.get("num_envs")
        if isinstance(count, int) and count > 3:  # allowed, and long
            return
        vector = make_vector_env(CLASSES[case["env"]], **arguments)
        try:
            vector.reset(seed=0)
            vector.step(vector.action_space.sample())
        finally:
            vector.close()
        return
    env = CLASSES[case["env"]](**arguments)
    play_on(env, env.reset(seed=0)[0], 1)
    env.close()
