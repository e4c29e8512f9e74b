"""Guess a network's observation from its sizes, where nothing describes it."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path

from poise.baselines.allowance import check_allowed, is_script
from poise.baselines.policy_files.checkpoints import check_no_checkpoint
from poise.baselines.policy_files.clip_network import JOINTS
from poise.baselines.policy_files.motion.config import TIME_STEP
from poise.baselines.policy_files.networks import onnx_session
from poise.baselines.policy_files.script_sizes import script_sizes

LONGEST = 50  # steps of a history that is guessed
#: terms that most policies see, and their numbers; joints and actions are added
ALWAYS = ("base_ang_vel", "projected_gravity")
MAYBE = (
    (("velocity_commands", 3), ("", 0)),
    (("", 0), ("phase", 2), ("phase_cos, phase_sin", 4)),
    (("", 0), ("base_lin_vel", 3)),
)
#: what trackers of a motion see, in the order of BeyondMimic: numbers for each joint, and others
TRACKERS = (
    (("motion_command", 2, 0), ("motion_anchor_ori_b", 0, 6), ("base_ang_vel", 0, 3),
     ("joint_pos_rel", 1, 0), ("joint_vel", 1, 0), ("last_action", 1, 0)),
    (("motion_command", 2, 0), ("motion_anchor_pos_b", 0, 3), ("motion_anchor_ori_b", 0, 6),
     ("base_lin_vel", 0, 3), ("base_ang_vel", 0, 3), ("joint_pos_rel", 1, 0), ("joint_vel", 1, 0),
     ("last_action", 1, 0)),
)  # fmt: skip
#: field of a description → what it is called in the projects that policies come from
WORDS = {
    "joints": "the order of the joints: joint_names, dof_names, joint_ids_map",
    "default": "the posture that positions are relative to: default_joint_pos, default_dof_pos, "
    "default_angles",
    "stiffness": "kp, kps, joint_stiffness, stiffness",
    "damping": "kd, kds, joint_damping, damping",
    "action_scale": "action_scale, policy_action_scale, actions.scale",
    "policy_period": "control_dt, step_dt, 1 / rl_rate, sim_dt × decimation",
    "observations": "the observation's terms in their order: obs_dict, observations, "
    "compute_observations, with their scales (obs_scales, ang_vel_scale) and history_length",
}
#: the same of a policy whose observation shows a clock
CLOCK = {"phase": "the clock's period in seconds: gait_period, period, cycle_time"}


@dataclass(frozen=True)
class Sizes:
    """What a file tells of its network.

    Attributes:
        inputs: name → numbers; None where they are left open.
        outputs: name → numbers; None where they are left open.
    """

    inputs: dict[str, int | None]
    outputs: dict[str, int | None]

    @property
    def gives_clip(self) -> bool:
        """Whether it takes the step of a clip, whose frames it gives."""
        return TIME_STEP in self.inputs and set(JOINTS) <= set(self.outputs)


@dataclass(frozen=True)
class Layout:
    """A usual observation of `size` numbers: these terms in a step, and so many steps."""

    terms: tuple[str, ...]
    frame: int
    steps: int

    def __str__(self) -> str:
        whole = self.frame * self.steps
        history = f"{whole} = {self.steps} × {self.frame}: a history of {self.steps} steps of "
        return (history if self.steps > 1 else f"{whole} = ") + " + ".join(self.terms)


def network_sizes(path: Path) -> Sizes:
    """Return the sizes of a network; TorchScript, which is code, must have been allowed.

    Raises ConfigError as `onnx_session`, `check_no_checkpoint` and `check_allowed` do.
    """
    if is_script(path):
        check_no_checkpoint(path)
        check_allowed(str(path))
        observation, action = script_sizes(path)
        return Sizes({"observation": observation}, {"action": action})
    session = onnx_session(path)
    sides = [{each.name: _numbers(each.shape) for each in side}
             for side in (session.get_inputs(), session.get_outputs())]  # fmt: skip
    return Sizes(*sides)


def _numbers(shape: list[object]) -> int | None:
    """The numbers of an input or output; axes left open are the batch's, but for the last."""
    if shape and not isinstance(shape[-1], int):
        return None
    return math.prod(size for size in shape if isinstance(size, int))


def layouts(size: int, actions: int, joints: int) -> Iterator[Layout]:
    """Usual observations of this size, the shortest history first; last, trackers with a history.

    Positions and velocities are of the `joints` of the robot or of those that are moved.
    """
    seldom: list[Layout] = []
    options = [
        (tuple(name for name, _ in (*chosen,) if name), sum(n for _, n in chosen))
        for chosen in product(*MAYBE)
    ]
    for steps in range(1, LONGEST + 1):
        if size % steps:
            continue
        for terms in TRACKERS:
            sizes = [(name, each * actions + fixed) for name, each, fixed in terms]
            frame = sum(numbers for _, numbers in sizes)
            if frame * steps == size:
                layout = Layout(tuple(f"{each} {m}" for each, m in sizes), frame, steps)
                if steps == 1:
                    yield layout
                else:
                    seldom.append(layout)
        for n, (names, more) in product(dict.fromkeys((actions, joints)), options):
            frame = 6 + 2 * n + actions + more
            if frame * steps == size:
                own = (f"joint_pos_rel {n}", f"joint_vel {n}", f"last_action {actions}")
                yield Layout((*(f"{each} 3" for each in ALWAYS), *names, *own), frame, steps)
    yield from seldom
