"""The configuration of a policy from outside: its network, joints, observation and action."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

#: one number for all joints, one for each in the policy's order, or by the joints' names
PerJoint = float | tuple[float, ...] | dict[str, float]


def _check_order(bounds: tuple[float, float], name: str) -> None:
    low, high = bounds
    if low > high:
        raise ValueError(f"{name}: {low} is above {high}; the least value comes first")


@dataclass(frozen=True)
class ObservationTerm:
    """A part of the observation.

    Attributes:
        term: its name, see `TERMS`.
        scale: factor, or one for each number of the term; after `clip`.
        clip: least and largest value.
        history: how many policy steps it shows, this one among them.
    """

    term: str
    scale: float | tuple[float, ...] = 1.0
    clip: tuple[float, float] | None = None
    history: int = field(default=1, metadata={"min": 1, "max": 1000})

    def __post_init__(self) -> None:
        if self.clip is not None:
            _check_order(self.clip, "clip")


@dataclass(frozen=True)
class PolicyFileConfig:
    """A policy that gives targets of joints to PD control.

        q* = offset + scale · action,    τ = K (q* − q) − D q̇   within the motors' limits

    The action is computed every `policy_period`, τ in every physics step.

    Attributes:
        policy: an ONNX file, or TorchScript (``.pt``), which is code and has to be allowed;
            relative to the YAML file. Empty: the one beside it.
        deploy: a configuration of unitree_rl_mjlab, unitree_rl_lab or unitree_rl_gym that says what
            is not said here; relative to the YAML file.
        joints: names in the policy's order; empty: `motors` tells.
        motors: numbers of the robot's joints, in the policy's order, where there are no names;
            empty: as many of the robot's first joints as the policy has actions.
        default: posture that joint positions are relative to [rad].
        stiffness: K [N·m/rad].
        damping: D [N·m·s/rad].
        action_joints: places in `joints` of those that the action moves; empty: all.
        action_scale: of the action, a number or one for each [rad].
        action_offset: q* of action zero [rad]; None: `default`.
        action_clip: least and largest value of each action.
        observations: the terms, in order.
        history: of several steps, oldest first: each term's side by side ("term"), or all terms of
            a step side by side ("frame").
        command: velocity that is asked for, forward and left [m/s], and turning left [rad/s].
        phase: period of the clock that a term ``phase`` shows [s].
        policy_period: of the policy [s].
        hold: joints that the policy does not have are held in the standing posture, critically
            damped, with this natural frequency [rad/s].
        digest: SHA-256 of the policy's files, so that results tell versions apart; it is filled in,
            whatever the YAML file says.
        described_in: the file that says all this, for errors; filled in likewise.
    """

    kind: Literal["policy-file"] = "policy-file"
    policy: str = ""
    deploy: str | None = None
    joints: tuple[str, ...] = ()
    motors: tuple[int, ...] = field(default=(), metadata={"min": 0})
    default: PerJoint = 0.0
    stiffness: PerJoint = field(default=40.0, metadata={"min": 0.0})
    damping: PerJoint = field(default=1.0, metadata={"min": 0.0})
    action_joints: tuple[int, ...] = field(default=(), metadata={"min": 0})
    action_scale: float | tuple[float, ...] = 0.25
    action_offset: PerJoint | None = None
    action_clip: tuple[tuple[float, float], ...] = ()
    observations: tuple[ObservationTerm, ...] = ()
    history: Literal["term", "frame"] = "term"
    command: tuple[float, float, float] = (0.0, 0.0, 0.0)
    phase: float = field(default=0.8, metadata={"above": 0.0})
    policy_period: float = field(default=0.02, metadata={"above": 0.0, "max": 1.0})
    hold: float = field(default=15.0, metadata={"min": 0.0, "max": 200.0})
    digest: str = ""
    described_in: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        for i, bounds in enumerate(self.action_clip):
            _check_order(bounds, f"action_clip[{i}]")
