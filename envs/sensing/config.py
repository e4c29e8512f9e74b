"""The configuration of the estimators of a robot's state."""

from dataclasses import dataclass, field
from typing import Literal

POSITIVE, NOT_NEGATIVE = {"above": 0.0}, {"min": 0.0}


@dataclass(frozen=True)
class InvariantConfig:
    """Process noise of the invariant filter; sensor noise comes from the realism level.

    Attributes:
        gyro_bias: Standard deviation of the gyroscope's bias at the start [rad/s].
        gyro_bias_walk: Change of that bias in a second [rad/s].
        attitude: Error of the attitude in addition to its drift, independent in every step [rad].
        kinematics: Error of a sole's position in addition to the encoders' noise [m].
        slide: Way that a sole that bears the robot wanders in a second [m].
        roll: Way that such a sole wanders for each rad/s that it turns by [m].
        lift: Way that a swing foot's sole may go in a second [m].
    """

    gyro_bias: float = field(default=0.02, metadata=NOT_NEGATIVE)
    gyro_bias_walk: float = field(default=0.001, metadata=NOT_NEGATIVE)
    attitude: float = field(default=0.01, metadata=POSITIVE)
    kinematics: float = field(default=0.002, metadata=POSITIVE)
    slide: float = field(default=0.02, metadata=NOT_NEGATIVE)
    roll: float = field(default=0.1, metadata=NOT_NEGATIVE)
    lift: float = field(default=5.0, metadata=NOT_NEGATIVE)


@dataclass(frozen=True)
class EstimatorConfig:
    """How the state is estimated.

    Attributes:
        kind: Estimator of the state: `odometry` integrates the accelerometer and is corrected by
            legs that stand; `inekf` is the invariant Kalman filter of the same measurements;
            `exact` is the true state, as late as the sensors are; `auto` is `exact` at a level
            whose sensors have no errors, and else `odometry`.
        predictor: How the state is predicted until the torques of this tick act:
            `promised` by the accelerations that the QP has promised, `rollout` by a simulation of
            the known robot with what its motors were asked for, `none` not at all; `auto` is
            `rollout` while motors run servos, whose accelerations are not predicted by the QP,
            else `promised`.
        external_force: Whether a rollout is pushed on by the force that nothing else explains.
        load: Whether a load that lasts is learned and borne, where sensors err or bodies are drawn:
            a payload, masses and centres of mass that are other than known.
        load_time: Time in which a load is learned [s].
        slide_speed: Speed from which soles are taken to slide, and friction is estimated for the QP
            [m/s]; 0: never.
        filtered: Whether joint velocities are filtered.
        joint_acceleration: Unmodelled acceleration of joints, step to step [rad/s²].
        turn_acceleration: Unmodelled angular acceleration of the root [rad/s²].
        acceleration: Error of the accelerometer in addition to its noise, step to step [m/s²].
        bias: Error of accelerometer and attitude together at the start [m/s²].
        bias_walk: Change of that error in a second [m/s²].
        slip: Error of a velocity measured by one leg, in addition to the joints' noise [m/s].
        roll_radius: Error of that velocity for each rad/s that the sole turns by [m].
        invariant: What only `inekf` goes by.
    """

    kind: Literal["auto", "odometry", "inekf", "exact"] = "auto"
    predictor: Literal["auto", "promised", "rollout", "none"] = "auto"
    external_force: bool = True
    load: bool = True
    load_time: float = field(default=2.0, metadata=POSITIVE)
    slide_speed: float = field(default=0.4, metadata=NOT_NEGATIVE)
    filtered: bool = True
    joint_acceleration: float = field(default=12.0, metadata=POSITIVE)
    turn_acceleration: float = field(default=5.0, metadata=POSITIVE)
    acceleration: float = field(default=0.05, metadata=POSITIVE)
    bias: float = field(default=0.2, metadata=POSITIVE)
    bias_walk: float = field(default=0.1, metadata=POSITIVE)
    slip: float = field(default=0.15, metadata=POSITIVE)
    roll_radius: float = field(default=3.0, metadata=POSITIVE)
    invariant: InvariantConfig = field(default_factory=InvariantConfig)


#: of a controller that brings an estimator of its own: what is measured, as late and as noisy
RAW = EstimatorConfig("odometry", predictor="none", load=False, slide_speed=0.0, filtered=False)
