"""The configuration of an external policy: its network, joints, observation and action."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Literal

from .motion.config import MotionConfig

#: one number for all joints, one for each in the policy's order, or by the joints' names
PerJoint = float | tuple[float, ...] | dict[str, float]

SCALES = {"min": -1e3, "max": 1e3}  # of an action, in rad
GAINS = {"min": 0.0, "max": 1e6}

#: what an output may be: the action, and gains that come with it
ROLES = ("action", "stiffness", "damping")


def _new(default: Any, **bounds: float) -> Any:
    """A field that files of before do not have: left out where it is its default."""
    return field(default=default, metadata={"omit": "default", **bounds})


def _check_order(bounds: tuple[float, float], name: str) -> None:
    low, high = bounds
    if low > high:
        raise ValueError(f"{name}: {low} is above {high}; the least value comes first")


@dataclass(frozen=True)
class ObservationTerm:
    """A part of the observation: a term, or several side by side, in one step or several.

    Attributes:
        term: its name, see `TERMS`.
        scale: factor, or one for each number of the term, or by the names of its joints; after
            `clip`.
        clip: least and largest value.
        offset: what is added to its numbers before `clip`, one number or one for each: of
            ``projected_gravity`` it is a lean that the policy is shown and corrects.
        history: how many policy steps it shows, the last `lag` ones left out.
        frame: in the place of `term`: parts that lie side by side in each of these steps.
        values: the numbers of the term ``constant``.
        joints: names or patterns of the joints that it shows, of a term that has a number for each.
        pick: the places in the term's numbers that it shows.
        at_rest: what it shows in their place while no velocity is commanded, before `clip`.
        newest_first: whether the history begins with the newest step.
        lag: policy steps by which the newest one shown is old; 1: this step is left out.
        ahead: policy steps by which the frames of a motion's term are ahead, side by side; negative
            behind; empty: the present one.
        fill: what a history shows of the time before the first step: that step, or zeros.
    """

    term: str = ""
    scale: PerJoint = 1.0
    clip: tuple[float, float] | None = None
    history: int = field(default=1, metadata={"min": 1, "max": 1000})
    frame: tuple[ObservationTerm, ...] = _new(())
    values: tuple[float, ...] = _new(())
    joints: tuple[str, ...] = _new(())
    pick: tuple[int, ...] = _new((), min=0)
    at_rest: tuple[float, ...] | None = _new(None)
    newest_first: bool = _new(False)
    lag: int = _new(0, min=0, max=1000)
    ahead: tuple[int, ...] = _new((), min=-1000, max=1000)
    fill: Literal["first", "zeros"] = _new("first")
    offset: float | tuple[float, ...] = _new(0.0)

    def __post_init__(self) -> None:
        if self.clip is not None:
            _check_order(self.clip, "clip")
        if bool(self.term) == bool(self.frame):
            raise ValueError("needs a term or a frame of them, and not both")

    @property
    def terms(self) -> Iterator[ObservationTerm]:
        """The terms in it: itself, or those of its frame."""
        if self.term:
            yield self
        for part in self.frame:
            yield from part.terms


@dataclass(frozen=True)
class Held:
    """How a joint is held that the action does not move; what is not said is as without it.

    Attributes:
        position: [rad].
        stiffness: K [N·m/rad].
        damping: D [N·m·s/rad].
    """

    position: float | None = field(default=None, metadata=SCALES)
    stiffness: float | None = field(default=None, metadata=GAINS)
    damping: float | None = field(default=None, metadata=GAINS)


@dataclass(frozen=True)
class JointLaw:
    """What a joint adds to its target, by the IMU's attitude, and its factors.

        q* = offset + action · scale · a + pitch · θ + pitch_rate · ω_y + roll · φ + roll_rate · ω_x

    R = R_z(yaw) R_y(θ) R_x(φ) is the root's attitude, ω its angular velocity along its own axes.
    A joint on the right has the mirror image of this law.

    Attributes:
        action: factor of what the policy asks for.
        stiffness: factor of K.
        damping: factor of D.
        pitch: of θ [rad/rad].
        pitch_rate: of ω_y [rad/(rad/s)].
        roll: of φ [rad/rad].
        roll_rate: of ω_x [rad/(rad/s)].
    """

    action: float = field(default=1.0, metadata={"above": 0.0, "max": 10.0})
    stiffness: float = field(default=1.0, metadata={"above": 0.0, "max": 10.0})
    damping: float = field(default=1.0, metadata={"above": 0.0, "max": 10.0})
    pitch: float = 0.0
    pitch_rate: float = 0.0
    roll: float = 0.0
    roll_rate: float = 0.0


@dataclass(frozen=True)
class NetworkMemory:
    """What a network gives in a step and is given in the next; zero when a trial starts.

    Attributes:
        input: its name; of TorchScript any, it comes after the observation, in this order.
        output: its name, or its place in what the network gives.
        shape: of TorchScript, which does not tell it.
    """

    input: str
    output: str | int
    shape: tuple[int, ...] = field(default=(), metadata={"min": 1})


@dataclass(frozen=True)
class KnownFile:
    """A file of a policy that others publish: its size and SHA-256."""

    bytes: int
    sha256: str


@dataclass(frozen=True)
class Origin:
    """Where a policy is published.

    Attributes:
        project: ``owner/name`` at GitHub.
        commit: of that project.
        folder: that its files are in there.
        files: name → its size and sum; the network is the first.
        licence: as SPDX abbreviates it.
        robot: that it was trained for, by its name here.
    """

    project: str
    commit: str
    files: dict[str, KnownFile]
    licence: str
    robot: str
    folder: str = ""

    def __post_init__(self) -> None:
        if not self.files:
            raise ValueError("files: must not be empty")


@dataclass(frozen=True)
class PolicyFileConfig:
    """A policy that gives targets of joints to PD control.

        q* = offset + scale · action,    τ = K (q* − q) − D q̇   within the motors' limits

    The action is computed every `policy_period`, τ in every physics step.

    Attributes:
        policy: an ONNX file, or TorchScript (``.pt``), which is code and has to be allowed;
            relative to the YAML file. Empty: the one beside it, or that of `origin`.
        origin: where the network is published; it is looked for by its sum, see `find_network`.
        deploy: a configuration of unitree_rl_mjlab, unitree_rl_lab or unitree_rl_gym that says what
            is not said here; relative to the YAML file.
        joints: names in the policy's order; empty: `motors` tells.
        motors: numbers of the robot's joints, in the policy's order, where there are no names;
            empty: as many of the robot's first joints as a list here has numbers, else all.
        default: posture that joint positions are relative to [rad].
        stiffness: K [N·m/rad].
        damping: D [N·m·s/rad].
        action_joints: places in `joints` of those that the action moves; empty: all.
        action_scale: of the action, a number or one for each [rad].
        action_offset: q* of action zero [rad]; None: `default`.
        action_clip: least and largest value of each action, or of all.
        held: posture of the joints that the action does not move [rad], in the order of `joints`
            or by name, then with gains of their own, see `Held`; None: `default` holds, or the
            standing posture where the policy does not have the joint.
        observations: the terms, in order; of a network with several inputs by their names.
        outputs: what the network's outputs are, of ``action``, ``stiffness`` and ``damping``: a
            name, or a place among them; the action is the first one by default.
        memory: inputs that are outputs of the step before; ``NAME_in`` and ``NAME_out``, and
            ``input_NAME`` and ``output_NAME``, are known to be.
        batch: whether the observation of TorchScript has an axis before its own; ONNX tells it.
        warm_up: how many times a network that remembers is asked before a trial's first action;
            what it answers then is not used.
        warm_up_with: what it is asked: the first observation, or zeros.
        history: of several steps, oldest first: each term's side by side ("term"), or all terms of
            a step side by side ("frame").
        motion: what a tracker follows; None: nothing, or what stands where a term shows a motion.
        command: velocity that is asked for, forward and left [m/s], and turning left [rad/s],
            unless the environment commands one.
        phase: period of the clock that the terms ``phase``, ``phase_sin`` and ``phase_cos`` show
            [s].
        phase_offsets: how far each leg is ahead of the clock, of its period.
        phase_runs: whether the clock runs always, or restarts when a velocity is commanded.
        policy_period: of the policy [s].
        copies: how many copies of the policy take turns within a `policy_period`, each with
            observations of its own, so that actions are less late. A policy that remembers or
            follows a motion has one.
        hold: joints that the policy does not have are held in the standing posture, critically
            damped, with this natural frequency [rad/s].
        digest: SHA-256 of the policy's files, so that results tell versions apart; it is filled in,
            whatever the YAML file says.
        described_in: the file with these fields, for errors; filled in.
        said: the fields that a file says; the others are as they are by default. Filled in.
    """

    kind: Literal["policy-file"] = "policy-file"
    policy: str = ""
    deploy: str | None = None
    joints: tuple[str, ...] = ()
    motors: tuple[int, ...] = field(default=(), metadata={"min": 0})
    default: PerJoint = field(default=0.0, metadata=SCALES)
    stiffness: PerJoint = field(default=40.0, metadata=GAINS)
    damping: PerJoint = field(default=1.0, metadata=GAINS)
    action_joints: tuple[int, ...] = field(default=(), metadata={"min": 0})
    action_scale: float | tuple[float, ...] = field(default=0.25, metadata=SCALES)
    action_offset: PerJoint | None = field(default=None, metadata=SCALES)
    action_clip: tuple[tuple[float, float], ...] = ()
    observations: tuple[ObservationTerm, ...] | dict[str, tuple[ObservationTerm, ...]] = ()
    history: Literal["term", "frame"] = "term"
    command: tuple[float, float, float] = (0.0, 0.0, 0.0)
    phase: float = field(default=0.8, metadata={"above": 0.0})
    policy_period: float = field(default=0.02, metadata={"above": 0.0, "max": 1.0})
    hold: float = field(default=15.0, metadata={"min": 0.0, "max": 200.0})
    digest: str = field(default="", metadata={"filled": True})
    described_in: str = field(default="", compare=False, metadata={"filled": True})
    said: tuple[str, ...] = field(
        default=(), compare=False, metadata={"omit": "default", "filled": True}
    )
    origin: Origin | None = field(default=None, metadata={"omit": "default"}, compare=False)
    held: tuple[float, ...] | dict[str, float | Held] | None = field(
        default=None, metadata={"omit": "default", **SCALES}
    )
    law: dict[str, JointLaw] = field(default_factory=dict, metadata={"omit": "default"})
    outputs: dict[str, str | int] = field(default_factory=dict, metadata={"omit": "default"})
    memory: tuple[NetworkMemory, ...] = _new(())
    batch: bool = _new(True)
    warm_up: int = _new(0, min=0, max=10_000)
    warm_up_with: Literal["first", "zeros"] = _new("first")
    motion: MotionConfig | None = field(default=None, metadata={"omit": "default"})
    phase_offsets: tuple[float, ...] = _new((0.0, 0.5))
    phase_runs: Literal["always", "commanded"] = _new("always")
    copies: int = _new(1, min=1, max=100)

    def __post_init__(self) -> None:
        for i, bounds in enumerate(self.action_clip):
            _check_order(bounds, f"action_clip[{i}]")
        for role in self.outputs:
            if role not in ROLES:
                raise ValueError(f"outputs: no such output: {role!r}; choices: {', '.join(ROLES)}")

    @property
    def inputs(self) -> dict[str, tuple[ObservationTerm, ...]]:
        """Input → what it shows; "" stands for the only one, whatever its name."""
        given = self.observations
        return given if isinstance(given, dict) else {"": given}
