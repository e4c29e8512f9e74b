"""The common part of the docstrings of all environments, and the tables that are made of terms."""

import inspect
import textwrap

from .observation import Terms, term_table
from .reward import reward_table

OBSERVATION = """
Box(−10, 10), in the heading frame (origin at the middle of the soles, x forward, y left); h is the
standing height of the CoM, ω = √(g/h). These terms one after the other, or those that `observation`
names (`terms` in place of them, `extra` after them); `observation_table(env.unwrapped.terms)` has
the index, entry and unit of every number of one environment.
"""

REWARDS = """
Rewards: the sum of these terms, each times its weight (`reward`, see `RewardWeights`). Those of the
posture are 0 in the step of a fall. "Half support" is half the size of the standing support
polygon.
"""

START = """
Start: the standing posture with uniform noise on joint positions, joint velocities and the root's
horizontal velocity (`noise`), the lowest sole on the ground; then pushes drawn from `pushes` by the
environment's generator. `reset(options=...)` takes

- "push": exactly these pushes: a mapping such as {"impulse": 12.0, "direction": 90.0,
  "duration": 0.1, "start": 0.5, "body": "torso"} (N·s; degrees counter-clockwise from forward,
  heading frame; seconds), a list of them, [] for none; other units: `parse_pushes`
- "noise": factor on the start noise, 0 for the exact standing posture
- "qpos" (nq,), "qvel" (nv,): the start itself, MuJoCo's conventions
- "fallen": number of a posture on the ground from which the robot has to get up

End: `terminated` by a fall: CoM below `fall.height` of its standing height, root tilted by more
than `fall.tilt`, anything but the feet on the ground (`fall.ground_contact`), or a simulation that
diverged; with `fall.terminates` false by the last alone. `truncated` after `duration` seconds.
`step` then needs a `reset`.

Info: "reward_terms" (name → weighted value; their sum is the reward), "push" (a list: start, force
[N], duration [s], body, direction [deg], impulse J [N·s], specific_impulse J/m [N·s/kg]),
"is_success" (tilt below `fall.quiet_tilt`, CoM slower than `fall.quiet_speed` and over the soles
for the last `fall.quiet_time`), "solver_failures" (ticks of the episode), "torque_saturation" (mean
fraction of motors at their limit), "root_wrench" (6,) (force [N] and moment [N·m] of a soft root in
the last tick).
"""

ARGUMENTS = """
`render_mode` (None, "rgb_array" or "human"), `width` and `height` of a frame [pixels], `camera`
(None for Poise's own, a `Camera`, or the name or id of one of the model's), and the fields of
`EnvConfig` by name: policy_period, duration, pushes, noise, fallen, fall, reward, observation,
realism (a level by name, file or fields; ideal by default), estimator, terrain (a kind or its
fields; level by default), physics (an engine by name, file or fields), clip_action. Fields may be
plain mappings. Raises ConfigError naming what is wrong.
"""


def filled(doc: str | None, terms: Terms) -> str | None:
    """A class docstring with its marks, such as <rewards> on a line alone, replaced.

    The tables are made from the environment's `terms` and from `RewardWeights`, so that a new term
    is documented without an edit here.
    """
    if doc is None:  # python -OO
        return None
    table = term_table(kind for kind in terms.values() if kind.default)
    off = [kind for kind in terms.values() if not kind.default]
    further = f"\n\nOff by default:\n\n{term_table(off)}" if off else ""
    parts = {
        "observation": f"{OBSERVATION.strip()}\n\n{table}{further}",
        "rewards": f"{REWARDS.strip()}\n\n{reward_table()}",
        "start": START.strip(),
        "arguments": ARGUMENTS.strip(),
    }
    text = inspect.cleandoc(doc)
    for name, part in parts.items():
        text = text.replace(f"<{name}>", part)
    return textwrap.indent(text, " " * 4).strip()
