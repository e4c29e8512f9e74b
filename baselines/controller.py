"""The interface of controllers: state and targets in, joint torques out."""

import inspect
from dataclasses import dataclass, field, fields
from functools import partial
from operator import attrgetter, is_not
from typing import Any, Protocol, runtime_checkable

import numpy as np

from poise.configs.errors import ConfigError
from poise.envs.compiled.block import Block
from poise.envs.compiled.calls import Kernel
from poise.envs.compiled.copies import Copyable
from poise.envs.compiled.memory import guarded_zeros
from poise.envs.compiled.mutable import Mutable
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot

COMMAND_ENTRIES = 8  # of `BaseController.orders`

_no_numbers = partial(guarded_zeros, 0)


@dataclass(eq=False)
class Outputs(Block):
    """The arrays in which compiled code finds what a controller's tick gave.

    Where servos give the torques, τ = K (q* − q) − D q̇ of each joint within the limits, motors that
    are real run them themselves.
    """

    tau: np.ndarray  # (nv−6,) joint torques [N·m]
    root_wrench: np.ndarray  # (6,) of a soft root
    failures: Mutable[int]  # ticks since the reset that could not be solved
    soft_root: bool
    # (nv,) accelerations that the torques are to bring; (0,): not known
    vdot: np.ndarray = field(default_factory=_no_numbers)
    # (nj,) q* of the servos [rad]; (0,): there are none
    target: np.ndarray = field(default_factory=_no_numbers)
    stiffness: np.ndarray = field(default_factory=_no_numbers)  # (nj,) K [N·m/rad]
    damping: np.ndarray = field(default_factory=_no_numbers)  # (nj,) D [N·m·s/rad]


@dataclass(frozen=True, eq=False)
class TargetArrays(Block):
    """All that a controller is asked to reach (nj = nv−6 joints), world axes."""

    q_ref: np.ndarray  # (nj,)
    v_ref: np.ndarray  # (nj,)
    a_ref: np.ndarray  # (nj,)
    root_axes: np.ndarray  # (3, 3) desired root orientation
    root_vel: np.ndarray  # (3,) desired angular velocity of the root, body axes
    root_acc: np.ndarray  # (3,)
    com: np.ndarray  # (3,) c_ref
    com_vel: np.ndarray  # (3,)
    com_acc: np.ndarray  # (3,)
    cop: np.ndarray  # (2,) p_ref
    angular_momentum: np.ndarray  # (3,) L_ref that the posture is to carry; zero: none


#: the arrays of `Targets`, in the order of the fields of `TargetArrays`
_MEMBERS = attrgetter(*(item.name for item in fields(TargetArrays)))


@dataclass
class Targets(Copyable):
    """References of one tick, world axes; nj = nv−6 joints.

    Writing into the arrays changes the targets of the controller's next tick.
    """

    q_ref: np.ndarray  #: (nj,) joint positions [rad]
    v_ref: np.ndarray  #: (nj,) [rad/s]
    a_ref: np.ndarray  #: (nj,) [rad/s²]
    root_axes: np.ndarray  #: (3, 3) root orientation
    com: np.ndarray  #: (3,) c_ref [m]
    root_vel: np.ndarray = field(default_factory=lambda: np.zeros(3))  #: [rad/s], body axes
    root_acc: np.ndarray = field(default_factory=lambda: np.zeros(3))  #: [rad/s²], body axes
    com_vel: np.ndarray = field(default_factory=lambda: np.zeros(3))  #: ċ_ref [m/s]
    com_acc: np.ndarray = field(default_factory=lambda: np.zeros(3))  #: c̈_ref [m/s²]
    cop: np.ndarray = field(default_factory=lambda: np.zeros(2))  #: p_ref [m]

    @classmethod
    def standing(cls, robot: Robot, state: RobotState) -> "Targets":
        """Standing posture, CoM and CoP over the middle of the soles, facing their heading."""
        arrays = state.robot
        cos, sin = state.heading
        yaw = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        nj = len(robot.joint_names)
        return cls(
            q_ref=arrays.q_standing.copy(),
            v_ref=np.zeros(nj),
            a_ref=np.zeros(nj),
            root_axes=yaw @ arrays.root_standing,
            com=state.origin + np.array([0.0, 0.0, robot.height_com]),
            cop=state.origin[:2].copy(),
        )

    # (3,) L_ref [N·m·s] that the posture carries in addition
    angular_momentum: np.ndarray = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self):
        for item in fields(self):
            given = np.asarray(getattr(self, item.name), dtype=float)
            array = guarded_zeros(given.shape)
            array[...] = given
            setattr(self, item.name, array)
        self._arrays: tuple[np.ndarray, ...] = ()

    def take(self, other: "Targets") -> None:
        """Copy the values of others."""
        for own, array in zip(_MEMBERS(self), _MEMBERS(other), strict=True):
            own[:] = array

    def arrays(self) -> TargetArrays:
        """The same arrays, not copies, for compiled code."""
        arrays = _MEMBERS(self)
        if not self._arrays or any(map(is_not, arrays, self._arrays)):
            self._arrays = arrays
            self._block = TargetArrays(*arrays)
        return self._block


@runtime_checkable
class Controller(Protocol):
    """A balance controller. It is independent of the environment and does not observe pushes.

    These three are enough. A subclass of `BaseController` can report more.
    """

    period: float  #: seconds between two calls of `torques`

    def reset(self, state: RobotState) -> None:
        """Forget everything; a new trial starts at `state`."""

    def torques(self, state: RobotState, targets: Targets) -> np.ndarray:
        """Joint torques (nu,) [N·m] to hold for one `period`."""


NO_WRENCH = np.zeros(6)
NO_WRENCH.flags.writeable = False


class BaseController(Copyable):
    """A `Controller` with the further members that environments and reports use, with defaults.

    A subclass has `robot` and `period`, defines `torques`, and replaces what is different for it.
    """

    robot: Robot  #: that it is made for
    period: float  #: seconds between two calls of `torques`
    config: Any = None  #: that it was made from
    com_offset: float = 0.0  #: forward, of the CoM that it stands with from the motion's [m]
    #: (8,) its command, `GaitCommand.array`, into which compiled code may write; None: it has none
    orders: np.ndarray | None = None
    #: True of one that brings an estimator of its own: it gets what is measured, late and noisy
    raw_measurements: bool = False

    @property
    def vdot(self) -> np.ndarray | None:
        """(nv,) accelerations that the last torques are to bring, or None where it has none."""
        return None

    @property
    def failures(self) -> int:
        """The ticks since the reset at which it found no solution."""
        return 0

    @property
    def root_wrench(self) -> np.ndarray:
        """(6,) external force [N] and moment [N·m] about the CoM on the root, if soft."""
        return NO_WRENCH

    @property
    def unwrapped(self) -> Controller:
        """The controller that decides: the inner one of a `WrappedController`, else itself."""
        return self

    def reset(self, state: RobotState) -> None:
        """Forget everything; a new trial starts at `state`. By default there is nothing."""

    def check(self) -> None:
        """Raise what went wrong inside compiled ticks, which cannot. By default nothing does."""

    def torques(self, state: RobotState, targets: Targets) -> np.ndarray:
        """Joint torques (nu,) [N·m] to hold for one `period`."""
        raise NotImplementedError

    def another(self) -> "BaseController":
        """A new controller like this one, with a memory of its own.

        Raises ConfigError where `robot` and `config` are not all that it is made from.
        """
        if tuple(inspect.signature(type(self)).parameters) != ("robot", "config"):
            raise cannot_be_shared()
        maker: Any = type(self)
        return maker(self.robot, self.config)


class CompiledController(BaseController):
    """A controller whose tick compiled code can run, without a call of Python.

    The environment then never calls `torques`. So a subclass that overrides `torques` runs from
    Python, unless it also overrides `compiled_tick`.
    """

    _same_tick = True  # whether `compiled_tick` is of the class that `torques` is of, or below it

    def __init_subclass__(cls, **kwargs: object) -> None:
        super().__init_subclass__(**kwargs)
        if "torques" in vars(cls) or "compiled_tick" in vars(cls):
            cls._same_tick = "compiled_tick" in vars(cls)

    @property
    def compiled(self) -> bool:
        """True where `compiled_tick` does what `torques` does; otherwise `torques` is called."""
        return self._same_tick

    def compiled_tick(self, state: RobotState, targets: Targets) -> tuple[Kernel, Block]:
        """A kernel and the block it works on: one call is one tick, see `outputs`."""
        raise NotImplementedError

    def outputs(self) -> Outputs:
        """The arrays in which a tick leaves its results."""
        raise NotImplementedError

    def gains(self) -> Block:
        """Return the block of gains that `compiled_tick` is bound to; another block rebinds it."""
        raise NotImplementedError


class WrappedController(BaseController):
    """A controller around another one, `inner`, whose further members it forwards.

    It calls `torques` of the inner one, which may be any `Controller`, for `robot`.
    """

    def __init__(self, inner: Controller, robot: Robot):
        self.inner, self.period = inner, inner.period
        self._base = inner if isinstance(inner, BaseController) else BaseController()
        self.robot = inner.robot if isinstance(inner, BaseController) else robot
        self.com_offset = self._base.com_offset

    @property
    def failures(self) -> int:
        return self._base.failures

    @property
    def vdot(self) -> np.ndarray | None:
        return self._base.vdot

    @property
    def root_wrench(self) -> np.ndarray:
        return self._base.root_wrench

    @property
    def unwrapped(self) -> Controller:
        """The innermost controller."""
        return self.inner.unwrapped if isinstance(self.inner, BaseController) else self.inner

    def reset(self, state: RobotState) -> None:
        self.inner.reset(state)

    def check(self) -> None:
        self._base.check()

    def torques(self, state: RobotState, targets: Targets) -> np.ndarray:
        return self.inner.torques(state, targets)

    def another(self) -> BaseController:
        """Raises ConfigError: the inner one may be of any kind."""
        raise cannot_be_shared()


def as_base_controller(controller: Controller, robot: Robot) -> BaseController:
    """The controller itself, or a `WrappedController` around one that is no `BaseController`."""
    if isinstance(controller, BaseController):
        return controller
    return WrappedController(controller, robot)


def cannot_be_shared() -> ConfigError:
    """The error of an environment that is asked for another one like it."""
    return ConfigError(
        "one object cannot control several environments: give each its own", field="controller"
    )
