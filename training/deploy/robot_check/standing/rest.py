"""Two seconds at rest with the QP: whether the robot stands before anything pushes it."""

from dataclasses import dataclass

import numpy as np

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.configs.errors import PoiseError
from poise.envs.robots.robot import Robot
from poise.training.benchmarking.trials.play import TINY, tilt_of

CONTROLLER = "momentum-qp"
DURATION = 2.0  # [s]


@dataclass(frozen=True)
class Rest:
    """A robot that stands without a push, with `CONTROLLER`.

    It starts as trials do, a little off its posture: exactly at rest even what hums stays quiet.

    Attributes:
        duration: simulated, or until it fell [s].
        fallen: whether it fell.
        chatter: Σ |τ_k − τ_k−1| / τ_max over the control ticks k, mean over the motors, over the
            second half [1/s].
        foot_drift, com_drift: largest horizontal distance of a sole and of the CoM from where they
            stood after the first half [m].
        lean: of the root from the standing posture at the end [°].
        unsolved: control ticks at which the QP was not solved; `ticks`: all.
        refused: why the controller does not support the robot; nothing is simulated then.
    """

    duration: float = 0.0
    fallen: bool = False
    chatter: float = 0.0
    foot_drift: float = 0.0
    com_drift: float = 0.0
    lean: float = 0.0
    unsolved: int = 0
    ticks: int = 0
    refused: str = ""


def stand_at_rest(robot: Robot) -> Rest:
    """Play `DURATION` of an ordinary start, always the same one."""
    try:
        env = ResidualBalanceEnv(robot, controller=CONTROLLER, pushes=None, duration=DURATION)
    except PoiseError as error:
        return Rest(refused=str(error))
    env.reset(seed=0)
    metrics, start = env.episode.metrics, _places(env)
    drift, half = np.zeros(len(start)), np.zeros(2)
    while env.episode.running:
        env.step_without_info(np.zeros(env.action_space.shape))
        drift = np.maximum(drift, np.linalg.norm(_places(env) - start, axis=1))
        if env.simulation.time <= 0.5 * DURATION:
            half = np.array([metrics.torque_variation, metrics.torque_time])
            start, drift = _places(env), np.zeros(len(start))
    change = np.array([metrics.torque_variation, metrics.torque_time]) - half
    if change[1] < TINY:  # it fell in the first half
        change += half
    return Rest(
        duration=env.simulation.time,
        fallen=env.fallen,
        chatter=float(change[0] / max(change[1], TINY)),
        com_drift=float(drift[0]),
        foot_drift=float(drift[1:].max()),
        lean=tilt_of(env),
        unsolved=int(metrics.failures),
        ticks=int(metrics.ticks),
    )


def _places(env: ResidualBalanceEnv) -> np.ndarray:
    """Return (1 + feet, 2) the CoM and the soles from above [m]."""
    state = env.simulation.state
    return np.vstack([state.com[:2], state.sole_points[:, :2]])
