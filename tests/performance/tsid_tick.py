"""The control tick against TSID's in the same run: `PYTHON -m tests.performance.tsid_tick`.

PYTHON is one that has TSID 1.10 and Poise's own dependencies (no torch):

    python -m venv venv_tsid
    CMEEL_RUN_TESTS=OFF venv_tsid/bin/pip install --no-binary tsid tsid==1.10.0
    venv_tsid/bin/pip install .

or Poise's own Python with `venv_tsid/lib/python3.X/site-packages/cmeel.prefix/lib/python3.X/
site-packages` in PYTHONPATH.

Both controllers get the same humanoid, states and tasks: CoM, posture, angular momentum, two
soles held with friction, the motors' limits. TSID's tick is `computeProblemData` (with Pinocchio's
kinematics), `SolverHQuadProgFast.solve` and `getActuatorForces`; ours MuJoCo's position and
velocity stages, contacts included, `update_state` and `momentum_tick`, or, with OSQP, the call of
the controller from Python. They take turns.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import numpy as np
import pinocchio as pin
import tsid

from poise.baselines.registry import load_controller
from poise.baselines.whole_body.momentum_qp import MomentumQP
from poise.envs.physics.state import RobotState
from poise.envs.robots.ground import contact_friction
from poise.envs.robots.robot import Robot
from tests.performance.recoveries import record
from tests.performance.tick_clock import TickClock
from tests.performance.urdf import urdf

STATES = 2000
PASSES = 5  # over the same ticks: the least time of each is what it takes undisturbed
FORCE_WEIGHT = 1e-5


class TsidTick:
    """TSID's formulation of the momentum QP's tasks."""

    def __init__(self, robot: Robot, controller: MomentumQP):
        p = controller.parameters
        posture, com, cop = (controller.tasks[name].block for name in ("posture", "com", "cop"))
        self.robot = robot
        self._kept: list[object] = []  # TSID holds references to samples without owning them
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "robot.urdf"
            path.write_text(urdf(robot))
            self.wrapper = tsid.RobotWrapper(str(path), [folder], pin.JointModelFreeFlyer(), False)
        model = self.wrapper.model()
        ids = [model.getJointId(name) for name in robot.joint_names]
        self._q = np.array([model.joints[i].idx_q for i in ids])
        self._v = np.array([model.joints[i].idx_v for i in ids])
        standing = self.coordinates(robot.standing_qpos, np.zeros(robot.model.nv))
        self.formulation = tsid.InverseDynamicsFormulationAccForce("tsid", self.wrapper, False)
        self.formulation.computeProblemData(0.0, *standing)

        self.contacts = [self._add_contact(sole, p.sole_damping) for sole in robot.soles]
        gains = np.zeros((2, len(ids)))
        gains[:, self._v - 6] = posture.stiffness[6:], posture.damping[6:]
        mass = robot.mass
        self.com = tsid.TaskComEquality("com", self.wrapper)
        self.com.setKp(com.stiffness)
        self.com.setKd(com.damping)
        self.formulation.addMotionTask(self.com, float(com.weight[0] * mass**2), 1, 0.0)
        self.posture = tsid.TaskJointPosture("posture", self.wrapper)
        self.posture.setKp(gains[0])
        self.posture.setKd(gains[1])
        self.formulation.addMotionTask(self.posture, float(posture.weight[6:].mean()), 1, 0.0)
        self.momentum = tsid.TaskAMEquality("momentum", self.wrapper)
        self.momentum.setKp(np.full(3, 10.0))
        self.momentum.setKd(np.zeros(3))
        self.formulation.addMotionTask(self.momentum, float(cop.weight[0]), 1, 0.0)
        self._hold(self.momentum, tsid.TrajectoryEuclidianConstant("L", np.zeros(3)))
        self._hold(self.posture, tsid.TrajectoryEuclidianConstant("q", standing[0][7:]))
        limit = np.zeros(len(ids))
        limit[self._v - 6] = p.torque_limit
        bounds = tsid.TaskActuationBounds("torques", self.wrapper)
        bounds.setBounds(-limit, limit)
        self.formulation.addActuationTask(bounds, 1.0, 0, 0.0)
        self._kept.append(bounds)
        self.solver = tsid.SolverHQuadProgFast("solver")
        sizes = self.formulation
        self.solver.resize(sizes.nVar, sizes.nEq, sizes.nIn)

    def _hold(self, task, trajectory) -> None:
        sample = trajectory.computeNext()
        self._kept += [trajectory, sample]
        task.setReference(sample)

    def _add_contact(self, sole, damping: float):
        corners = np.vstack([np.asarray(sole.polygon).T, np.zeros(len(sole.polygon))])
        weight = self.robot.mass * 9.81
        contact = tsid.Contact6d(
            sole.name, self.wrapper, f"sole_{sole.name}", corners, np.array([0.0, 0.0, 1.0]),
            contact_friction(self.robot.model, self.robot.ground_geom_id, sole.geom_ids),
            0.0, 10.0 * weight,
        )  # fmt: skip
        contact.setKp(np.zeros(6))
        contact.setKd(np.full(6, damping))
        frame = self.wrapper.model().getFrameId(f"sole_{sole.name}")
        contact.setReference(self.wrapper.framePosition(self.formulation.data(), frame))
        self.formulation.addRigidContact(contact, FORCE_WEIGHT)
        return contact

    def coordinates(self, qpos: np.ndarray, qvel: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pinocchio's q and v: quaternion xyzw, linear velocity in body axes, its joint order."""
        q, v = qpos.copy(), qvel.copy()
        q[3:7] = qpos[[4, 5, 6, 3]]
        v[:3] = pin.Quaternion(*qpos[3:7]).toRotationMatrix().T @ qvel[:3]
        q[self._q], v[self._v] = qpos[7:], qvel[6:]
        return q, v

    def begin(self, com: np.ndarray) -> None:
        """The CoM target of a recovery."""
        self._hold(self.com, tsid.TrajectoryEuclidianConstant("com", com))

    def time(self, state: RobotState) -> tuple[float, bool]:
        """Seconds of one tick, and whether it was solved."""
        q, v = self.coordinates(state.qpos, state.qvel)
        start = time.perf_counter()
        data = self.formulation.computeProblemData(0.0, q, v)
        solution = self.solver.solve(data)
        self.formulation.getActuatorForces(solution)
        return time.perf_counter() - start, solution.status == 0

    def check(self, state: RobotState) -> None:
        """The URDF is the same robot: its CoM is where MuJoCo's is, to a micrometre."""
        self.formulation.computeProblemData(0.0, *self.coordinates(state.qpos, state.qvel))
        error = np.abs(self.wrapper.com(self.formulation.data()) - state.com).max()
        assert error < 1e-6, f"the CoMs differ by {error} m"


def main() -> None:
    env, recoveries = record(every=1)
    other, clock = TsidTick(env.robot, env.controller), TickClock(env.controller)
    osqp = load_controller("momentum-qp-osqp", env.robot)
    clock.time(recoveries[0][0])  # compiled
    least, unsolved = None, 0
    for _ in range(PASSES):
        times = []
        for recovery in recoveries:
            env.controller.reset()
            osqp.reset()
            other.begin(recovery[0].targets.com.copy())
            for tick in recovery:
                other.check(tick.state)
                seconds, solved = other.time(tick.state)
                unsolved += not solved
                ours = clock.time(tick)
                start = time.perf_counter()
                osqp.torques(tick.state, tick.targets)
                times.append([seconds, *ours, time.perf_counter() - start])
        least = np.array(times) if least is None else np.minimum(least, times)
    chosen = least[np.linspace(0, len(least) - 1, min(STATES, len(least))).astype(int)]
    base, parts, slow_solver = chosen[:, 0], chosen[:, 1:4], chosen[:, 4]
    rows = {"TSID": base, "ours, q and v to torques": parts.sum(axis=1),
            "ours, momentum_tick alone": parts[:, 2],
            "ours with OSQP, from Python": slow_solver + parts[:, :2].sum(axis=1)}  # fmt: skip
    print(f"{len(chosen)} states; TSID left {unsolved} of {PASSES * len(least)} unsolved")
    print("| tick | median | p99 | p99 over median | over TSID |")
    print("| --- | --- | --- | --- | --- |")
    for name, times in rows.items():
        median, slow = float(np.median(times)), float(np.percentile(times, 99))
        print(f"| {name} | {1e6 * median:.1f} µs | {1e6 * slow:.1f} µs | {slow / median:.2f} | "
              f"{median / np.median(base):.2f} |")  # fmt: skip


if __name__ == "__main__":
    main()
