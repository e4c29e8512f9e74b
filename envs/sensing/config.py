"""The configuration of the estimators of a robot's state."""

from dataclasses import dataclass, field
from typing import Literal

POSITIVE, NOT_NEGATIVE = {"above": 0.0}, {"min": 0.0}


@dataclass(frozen=True)
class InvariantConfig:
    """What the invariant filter thinks of the world, besides the noises of the sensors.

    Attributes:
        gyro_bias: Bias of the gyroscope at the start, as `inekf` thinks [rad/s].
        gyro_bias_walk: Change of that bias in a second [rad/s].
        attitude: Error of the attitude besides its drift, taken as new in every step [rad].
        kinematics: Error of a sole's place besides the encoders' noise [m].
        slide: Way that a sole that bears the robot wanders in a second [m].
        roll: Way that such a sole wanders for each rad/s that it turns by [m].
        lift: Way that a sole in the air may go in a second [m].
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
        predictor: Way in which the state is led on to when the torques of this tick will act:
            `promised` by the accelerations that the QP has promised, `rollout` by a simulation of
            the known robot with what its motors were asked for, `none` not at all; `auto` is
            `rollout` while motors run servos, whose accelerations nobody promises, else `promised`.
        external_force: Whether a rollout is pushed on by the force that nothing else explains.
        load: Whether a load that lasts is learned and borne, where sensors err or bodies are drawn:
            a payload, masses and centres of mass that are other than known.
        load_time: Time in which a load is learned [s].
        slide_speed: Speed from which soles are taken to slide, and then tell how much friction a QP
            may count on [m/s]; 0: never.
        filtered: Whether joint velocities are filtered.
        joint_acceleration: Acceleration of joints that nobody knows of, step to step [rad/s²].
        turn_acceleration: Angular acceleration of the root that nobody knows of [rad/s²].
        acceleration: Error of the accelerometer besides its noise, from step to step [m/s²].
        bias: Error of accelerometer and attitude together at the start [m/s²].
        bias_walk: Change of that error in a second [m/s²].
        slip: Error of a velocity that one leg tells, besides the joints' noise [m/s].
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
