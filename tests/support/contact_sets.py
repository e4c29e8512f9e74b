"""The QPs of `ContactSets`, one at a time: as problems, and solved."""

from poise.baselines.solvers import QP
from poise.baselines.whole_body.tick import assemble_contacts, contact_tick, update_origin
from poise.envs.physics.state import RobotState


def problem(sets, state, targets, soles, tasks=(), load_limits=None):
    """The reduced QP with `soles` in contact, `tasks` after those of the configuration."""
    block = _limited(sets, state, targets, soles, tasks, load_limits)
    assemble_contacts(block)
    ws = block.problem.workspace
    return QP(ws.H, ws.g, ws.C, ws.l, ws.u)


def tick(sets, state, targets, soles, tasks=(), load_limits=None):
    """The torques (nu,) [N·m], and the workspace with the solution."""
    block = _limited(sets, state, targets, soles, tasks, load_limits)
    contact_tick(block)
    ws = block.problem.workspace
    return ws.tau[sets.arrays.motor_dofs - 6].copy(), ws


def restricted(sets, state, targets, soles):
    """The state with these soles only."""
    own = sets.bind(soles, state.arrays, targets.arrays()).problem.state
    update_origin(own)
    return RobotState(sets.sets[soles].arrays, own)


def _limited(sets, state, targets, soles, tasks, load_limits):
    """What a tick works on, with largest vertical forces (len(soles),) of the soles [N]."""
    block = sets.bind(soles, state.arrays, targets.arrays(), tasks)
    if load_limits is not None:
        block.limited = 1
        block.load_limits[:] = load_limits
    return block
