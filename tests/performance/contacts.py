"""Contact of both engines where points slide and land, against the time step and other options.

    python -m tests.performance.contacts [--robot humanoid]

Joint servos hold the standing robot. *Slide*: it stands, then all of it moves at 2 m/s: the largest
force of the ground over the weight within 30 ms, and the time without contact. Coulomb's friction
slows it and lifts nothing. *Land*: it falls, tilted by 5°, onto its feet at 0.5 m/s each way: the
velocity of the CoM 0.15 s later, and how far it is from that of the row's engine at its finest
step. `--physics drake` needs Drake; without it, MuJoCo's rows are printed.
"""

from __future__ import annotations

import argparse
import importlib.util
from dataclasses import dataclass, field

import mujoco
import numpy as np

from poise.envs.balance.servos import holding_torques
from poise.envs.physics.engines.config import Physics
from poise.envs.physics.engines.engine import make_engine
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.robot import Robot, load_robot

MUJOCO = Physics()
TICK = 2e-3  # [s] of the servos
STIFFNESS, DAMPING = 500.0, 20.0  # of the servos [N·m/rad], [N·m·s/rad]
SPEED = 2.0  # of the slide [m/s]
MUJOCO_STEPS = (1, 2, 4, 16)
DRAKE_STEPS = (1, 2, 4, 8)


@dataclass(frozen=True)
class Setting:
    """An engine with options. The last of a `family` has its finest step."""

    family: str
    name: str
    physics: Physics = MUJOCO
    steps: int = 1  #: physics steps of MuJoCo in a tick
    options: dict[str, float] = field(default_factory=dict)  #: of MuJoCo's model


def settings() -> list[Setting]:
    """The rows of the table."""
    rows = [Setting("MuJoCo", f"MuJoCo, {2 / n:g} ms", steps=n) for n in MUJOCO_STEPS]
    for name, options in (
        ("elliptic cones", {"cone": 1}),
        ("elliptic cones, impratio 10", {"cone": 1, "impratio": 10.0}),
        ("time constant 10 ms", {"solref": 0.01}),
        ("time constant 40 ms", {"solref": 0.04}),
    ):
        rows.insert(-1, Setting("MuJoCo", f"MuJoCo, {name}", options=options))
    if importlib.util.find_spec("pydrake") is None:
        return rows
    for contact in ("lagged", "sap"):
        rows += [
            Setting(contact, f"Drake, {contact}, {2 / n:g} ms",
                    Physics("drake", substeps=n, contact=contact))
            for n in DRAKE_STEPS
        ]  # fmt: skip
    for name, given in (
        ("a third of `sink`", {"sink": Physics.sink / 3.0}),
        ("three times `sink`", {"sink": 3.0 * Physics.sink}),
        ("`dissipation` 20 s/m", {"dissipation": 20.0}),
    ):
        rows.insert(-len(DRAKE_STEPS) - 1, Setting("lagged", f"Drake, {name}",
                                                   Physics("drake", **given)))  # fmt: skip
    return rows


class Held:
    """A robot whose joints servos hold in its standing posture."""

    def __init__(self, name: str, setting: Setting):
        robot: Robot = load_robot(name)
        model = robot.model
        model.opt.timestep = TICK / setting.steps if setting.physics == MUJOCO else TICK
        for option, value in setting.options.items():
            if option == "solref":
                model.geom_solref[:, 0] = value
            else:
                setattr(model.opt, option, value)
        self.robot, self.steps = robot, setting.steps
        self.simulation = Simulation(robot)
        self.simulation.engine = make_engine(setting.physics, robot, self.simulation.data)
        self._hold, self._dofs = holding_torques(robot), robot.motor_dofs

    def reset(self, qpos: np.ndarray | None = None, qvel: np.ndarray | None = None) -> None:
        self.simulation.reset(qpos, qvel)

    def tick(self) -> float:
        """The force of the ground over the weight in the last physics step of a tick."""
        data, dofs = self.simulation.data, self._dofs
        away = self.robot.standing_qpos[dofs + 1] - data.qpos[dofs + 1]
        torques = self._hold + STIFFNESS * away - DAMPING * data.qvel[dofs]
        state = self.simulation.step(torques, self.steps)
        return float(state.contact_wrench[2] / self.robot.units.force)


def slide(held: Held) -> tuple[float, float]:
    """Largest force of the ground [weights], and time without contact [s]."""
    held.reset()
    for _ in range(100):
        held.tick()
    data = held.simulation.data
    qpos, qvel = data.qpos.copy(), data.qvel.copy()
    qvel[0] += SPEED
    held.reset(qpos, qvel)
    forces = [held.simulation.state.contact_wrench[2] / held.robot.units.force]
    forces += [held.tick() for _ in range(15)]
    return float(max(forces)), TICK * sum(force < 1e-6 for force in forces)


def land(held: Held) -> np.ndarray:
    """(3,) velocity of the CoM [m/s] 0.15 s after the start of the fall."""
    qpos = held.robot.standing_qpos.copy()
    tilt = np.array([np.cos(np.radians(2.5)), 0.0, np.sin(np.radians(2.5)), 0.0])
    mujoco.mju_mulQuat(qpos[3:7], tilt, held.robot.standing_qpos[3:7])
    qpos[2] += 0.03
    qvel = np.zeros(held.robot.model.nv)
    qvel[:3] = 0.5, 0.2, -0.5
    held.reset(qpos, qvel)
    for _ in range(75):
        held.tick()
    return np.array(held.simulation.state.com_vel)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robot", default="humanoid")
    robot = parser.parse_args().robot
    found = []
    for setting in settings():
        held = Held(robot, setting)
        found.append((setting, *slide(held), land(held)))
    finest = {setting.family: velocity for setting, _, _, velocity in found}
    print("| setting | slide: largest force [weights] | no contact [ms of 30] | "
          "landed: CoM velocity [mm/s] | from its finest step |")  # fmt: skip
    print("| --- | --- | --- | --- | --- |")
    for setting, force, away, velocity in found:
        apart = 1e3 * np.linalg.norm(velocity - finest[setting.family])
        text = ", ".join(f"{1e3 * v:.0f}" for v in velocity)
        print(f"| {setting.name} | {force:.2f} | {1e3 * away:.0f} | {text} | {apart:.0f} |")


if __name__ == "__main__":
    main()
