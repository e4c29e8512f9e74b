"""What the momentum QP makes of a motion that it is exactly on."""

from dataclasses import replace

import numpy as np

from poise.baselines.balance.references.reference_motion import ReferenceMotion
from poise.baselines.balance.references.targets import motion_arrays, no_offsets, update_targets
from poise.baselines.controller import Targets
from poise.baselines.whole_body.gains import MomentumQPConfig
from poise.baselines.whole_body.momentum_qp import MomentumQP
from poise.configs.errors import ConfigError
from poise.envs.robots.robot import Robot

from .check import Feasibility
from .trajectory import PlantedRobot


def with_gap(
    judged: Feasibility,
    motion: ReferenceMotion,
    robot: Robot,
    config: MomentumQPConfig | None = None,
) -> Feasibility:
    """The same with the gap of the QP, one tick a sample.

    The robot is put on the motion, with its velocities, and with the motion's ZMP as the measured
    CoP. The gap is ‖[ΔP; ΔL/h]‖/(m g) of Δ = A v̇_qp − A v̇_ref, h the CoM's standing height: what
    of the motion's own acceleration the QP has to give up for its cones, torques and limits, and
    for what its tasks weigh. The CoM is asked for where the motion has it, without the offset of a
    controller's gains. Raises ConfigError for a motion with steps.
    """
    if motion.footing is not None:
        raise ConfigError("is not for motions with steps: this QP keeps both soles planted",
                          source=motion.name, field="qp")  # fmt: skip
    planted, qp = PlantedRobot(robot), MomentumQP(robot, config)
    block, none = motion_arrays(motion), no_offsets()
    gaps = np.empty(len(judged.times))
    for k, time in enumerate(judged.times):
        vdot = planted.at(*motion.sample(time)[:3])
        state = planted.state
        state.arrays.cop[:] = judged.zmp[k]
        targets = Targets.standing(robot, state)
        update_targets(planted.arrays, state.arrays, block, time, robot.com_ahead, none,
                       targets.arrays())  # fmt: skip
        qp.reset()
        qp.torques(state, targets)
        missed = state.A @ (qp.vdot - vdot)
        missed[3:] /= robot.height_com
        gaps[k] = np.linalg.norm(missed) / robot.units.force
    return replace(judged, gap=gaps)
