"""Rows of tasks as their kernels fill them, and as NumPy has them."""

import numpy as np

from poise.baselines.balance.stepping.planning.swing_task import swing_gains, swing_task
from poise.baselines.controller import Targets
from poise.baselines.whole_body.parts.reduced_motion import ReducedMotion
from poise.baselines.whole_body.tasks.task import RowArrays, Rows, TaskTick, task_input
from poise.envs.compiled.memory import guarded_zeros


def filled(bound, state):
    """The rows that a task's kernel fills for a state."""
    k = bound.part.size
    arrays = RowArrays(guarded_zeros((k, len(state.qvel))), guarded_zeros(k), guarded_zeros(k))
    nv, nj = len(state.qvel), len(state.q)
    V, B, T = guarded_zeros((nv, 1)), guarded_zeros((6, 1)), guarded_zeros((nj, 1))
    motion = ReducedMotion(V, guarded_zeros(nv), B, T, guarded_zeros(nj), 0, 1)
    targets, nothing = at_rest(state).arrays(), (guarded_zeros(2), guarded_zeros(3))
    bound.part.kernel(
        TaskTick(state.arrays, targets, state.arrays, *nothing, motion, bound.block, arrays)
    )
    return Rows(arrays.A, arrays.b, arrays.weights)


def at_rest(state):
    """Targets of a state that is to stay as it is."""
    zeros = np.zeros(len(state.q))
    return Targets(state.q.copy(), zeros, zeros, state.root_axes.copy(), state.com.copy())


def given(state):
    """What a task reads in NumPy that needs no targets."""
    return task_input(state, at_rest(state))


def swing(state, sole, reference, axes, task):
    """The task of a sole's pose: `reference` (3, 3), sole `axes` (3, 3)."""
    frames = np.array(reference, dtype=float), np.array(axes, dtype=float)
    return swing_task(sole, *frames, swing_gains(state.robot, task))


def swing_rows(state, sole, reference, axes, task):
    """The rows of that task."""
    return filled(swing(state, sole, reference, axes, task), state)


#: kind → a task of the humanoid whose rows have a part of everything
EXAMPLES = {
    "orientation": {"body": "left_upper_arm", "stiffness": 30.0, "damping_ratio": 0.7},
    "position": {"body": "right_lower_arm", "point": [0.18, 0.18, 0.18], "damping_ratio": 0.6},
}


def described(*names, **changes):
    """The `tasks` of a configuration: some examples, each under its kind."""
    return {name: {"kind": name, **EXAMPLES[name], **changes} for name in names or EXAMPLES}
