"""The kernels of performed motions, as `baselines/warmup.py` compiles them."""

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.envs.compiled.calls import NO_KERNEL, address_of

from .performing.motion_step import MotionStep
from .performing.tick import perform_tick


def performing() -> None:
    """The performance of a motion whose feet leave the ground."""
    env = ResidualBalanceEnv(controller="motion-step", motion="kick", duration=0.1)
    env.reset(seed=0)
    controller = env.controller
    assert isinstance(controller, MotionStep)
    state, targets = env.simulation.state, env.targets
    tick = controller.around(controller.blocks(state, controller.resting(state)), targets)
    address_of(perform_tick, tick)
    env.bind(tick, NO_KERNEL)
