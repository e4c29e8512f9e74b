"""An external controller, in the three places where it can act.

    python examples/own_controller.py

`StifferAnkles` wraps the momentum QP and moves its CoP target with the capture point. It is a
`poise.baselines.Controller`: `period`, `reset(state)`, `torques(state, targets)`.
"""

import gymnasium
import numpy as np

import poise  # noqa: F401  (registers the environments)
from poise.baselines import MomentumQP, Targets, load_controller
from poise.envs import Robot, RobotState, Simulation, load_robot, parse_pushes

PUSH = {"impulse": 8.0, "direction": 90.0, "duration": 0.1, "start": 0.5, "body": "torso"}


class StifferAnkles:
    """The momentum QP with p_ref + gain · (ξ − p_ref): the CoP is sent after the capture point."""

    def __init__(self, robot: Robot, gain: float = 0.5):
        self.qp: MomentumQP = load_controller("momentum-qp", robot)
        self.period, self.gain = self.qp.period, gain

    def reset(self, state: RobotState) -> None:
        self.qp.reset(state)

    def torques(self, state: RobotState, targets: Targets) -> np.ndarray:
        targets.cop += self.gain * (state.capture_point - targets.cop)
        return self.qp.torques(state, targets)


def drive_simulation(robot: Robot, seconds: float = 3.0) -> bool:
    """Return the bare loop: a simulation, a controller, targets. No environment."""
    simulation, controller = Simulation(robot), StifferAnkles(robot)
    state = simulation.state
    simulation.set_pushes(parse_pushes(PUSH, robot, state.support_margin))
    controller.reset(state)
    steps = round(controller.period / simulation.arrays.timestep)
    while simulation.time < seconds and not state.other_contact:
        targets = Targets.standing(robot, state)
        state = simulation.step(controller.torques(state, targets), steps)
    return not state.other_contact


def drive_torque_balance(robot: Robot) -> bool:
    """Return the environment with torques as actions: the controller reads the state beside it."""
    controller = StifferAnkles(robot)
    env = gymnasium.make(
        "poise/TorqueBalance-v0", robot=robot, policy_period=controller.period, duration=3.0
    )
    env.reset(seed=0, options={"push": PUSH})
    state = env.unwrapped.simulation.state  # a view: it follows the simulation
    controller.reset(state)
    done = False
    while not done:
        torques = controller.torques(state, Targets.standing(robot, state))
        action = np.clip(torques / robot.torque_limit, -1.0, 1.0)
        _, _, terminated, truncated, info = env.step(action)
        done = terminated or truncated
    return bool(info["is_success"])


def under_a_residual(robot: Robot) -> bool:
    """The controller as the base of the residual environment: a policy could learn on top."""
    env = gymnasium.make(
        "poise/ResidualBalance-v0", robot=robot, controller=StifferAnkles(robot), duration=3.0
    )
    env.reset(seed=0, options={"push": PUSH})
    done = False
    while not done:
        _, _, terminated, truncated, info = env.step(np.zeros(env.action_space.shape))
        done = terminated or truncated
    return bool(info["is_success"])


if __name__ == "__main__":
    humanoid = load_robot("humanoid")
    for place in (drive_simulation, drive_torque_balance, under_a_residual):
        print(f"{place.__name__}: {'stands' if place(humanoid) else 'fell'}")
