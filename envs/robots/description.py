"""The description of a robot: which model it is, where its feet are, how it stands."""

from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from typing import Literal, TypeVar

from poise.configs.errors import ConfigError, shown

Value = TypeVar("Value")
PASSIVE = {"min": 0.0, "max": 1e6, "omit": "default"}  # of what a joint has without a motor


@dataclass(frozen=True)
class SourceDescription:
    """The source of the model: exactly one of `builder`, `mjcf`, `urdf` and `menagerie`."""

    builder: Literal["humanoid"] | None = None  #: a model that Poise builds itself
    mjcf: str | None = None  #: path of an MJCF file, relative to the YAML file
    #: path of a URDF file, relative to the YAML file, or ``package://NAME/path``, see `find_file`
    urdf: str | None = None
    #: of the SRDF file beside it, in the same form, for the links that do not collide
    srdf: str | None = None
    #: folder and file of a model of MuJoCo Menagerie, see `find_model`
    menagerie: str | None = None
    licence: str = ""  #: of the model's files, for whoever reads the description

    def __post_init__(self) -> None:
        sources = (self.builder, self.mjcf, self.urdf, self.menagerie)
        if sum(given is not None for given in sources) != 1:
            raise ValueError("give exactly one of builder, mjcf, urdf and menagerie")
        if self.srdf is not None and self.urdf is None:
            raise ValueError("srdf: goes with urdf alone")


@dataclass(frozen=True)
class FootDescription:
    """A foot, whose collision geometry makes its sole."""

    name: str  #: a name for the foot, such as ``left``
    body: str  #: the foot's body in the model
    #: the geoms of the sole, or bodies whose collision geoms they are; empty for all collision
    #: geoms of the body and of what is welded to it
    geoms: tuple[str, ...] = ()


@dataclass(frozen=True)
class PostureDescription:
    """The standing posture. Small errors are levelled out so that both soles lie flat."""

    keyframe: str | None = None  #: of the MJCF, to start from; None: the model's zero posture
    unit: Literal["degree", "radian"] = "degree"  #: of the hinges in `joints`; slides are in [m]
    #: joint name, or pattern such as ``*_knee``, → position
    joints: dict[str, float] = field(default_factory=dict)
    #: where the CoM is to stand: ``posture``, where this posture has it; ``middle``, over that of
    #: the soles, to which the legs shift this posture; ``controller``, where the controller's gains
    #: put it, which were searched on this very robot
    com: Literal["posture", "middle", "controller"] = "posture"


@dataclass(frozen=True)
class OptionDescription:
    """Simulation options that replace those of the model; None: the model's own."""

    timestep: float = field(default=0.002, metadata={"min": 1e-4, "max": 0.01})  #: [s]
    integrator: Literal["implicitfast", "implicit", "Euler"] = "implicitfast"  #: MuJoCo's
    solver: Literal["Newton", "CG", "PGS"] = "Newton"  #: MuJoCo's, of constraints
    #: sliding friction coefficient of every geom
    friction: float | None = field(default=None, metadata={"above": 0.0, "max": 5.0})
    cone: Literal["pyramidal", "elliptic"] | None = None  #: form of MuJoCo's friction cones
    #: how much stiffer friction is than the contact itself, so that feet that press against each
    #: other do not creep apart; the model's own is mostly 1
    impratio: float | None = field(default=None, metadata={"above": 0.0, "max": 1e4})


@dataclass(frozen=True)
class RobotDescription:
    """A floating-base biped as data; ``configs/robots/*.yaml`` are examples.

    Of mappings from joint names or patterns, an exact name wins over a pattern, an earlier pattern
    over a later.
    """

    name: str  #: the robot's name
    source: SourceDescription  #: where the model comes from
    root: str  #: the floating body, which has the free joint
    feet: tuple[FootDescription, ...]  #: the two feet
    posture: PostureDescription = field(default_factory=PostureDescription)
    forward: tuple[float, float, float] = (1.0, 0.0, 0.0)  #: the robot's, in the root body's frame
    #: what reference motions move: role, such as ``knees`` → joint name or pattern → scale, so that
    #: +1 degree of the role turns the joint by ``scale`` degrees. Pitch is positive about the
    #: robot's left axis, roll about its forward axis, of the segment that is further from the
    #: pelvis: knees bend and the torso leans forward with positive pitch
    roles: dict[str, dict[str, float]] = field(default_factory=dict)
    #: joint name or pattern → largest torque [N·m]. Needed where the model's actuators do not bound
    #: it; wins over the model's own limits, and gives a motor to a joint that has none
    torque_limits: dict[str, float] = field(
        default_factory=dict, metadata={"above": 0.0, "max": 1e6}
    )
    #: joint name or pattern → inertia of the rotor as the joint feels it, times gear² [kg·m²; of a
    #: slide kg]; wins over the model's. URDF files cannot say it
    armature: dict[str, float] = field(default_factory=dict, metadata=PASSIVE)
    #: the same of viscous damping [N·m·s/rad]
    damping: dict[str, float] = field(default_factory=dict, metadata=PASSIVE)
    #: the same of dry friction [N·m]
    frictionloss: dict[str, float] = field(default_factory=dict, metadata=PASSIVE)
    #: that a benchmark pushes, the first where one is wanted; empty for the root alone
    push_bodies: tuple[str, ...] = ()
    #: name of the plane, or of the level box, that is the ground; None: the model's own plane, else
    #: the level box that its robot stands on. A model without either gets a plane
    ground: str | None = None
    options: OptionDescription = field(default_factory=OptionDescription)

    def __post_init__(self) -> None:
        if len(self.feet) != 2:
            raise ValueError(f"feet: a biped has two feet, {len(self.feet)} given")
        names = [foot.name for foot in self.feet]
        if len({*names, "ground", ""}) != 4:
            raise ValueError(f"feet: names must be different and neither 'ground' nor '': {names}")
        if self.feet[0].body == self.feet[1].body:
            raise ValueError(f"feet: both are the body {self.feet[0].body!r}")
        if not any(self.forward):
            raise ValueError("forward: must not be the zero vector")


def match_names(
    patterns: dict[str, Value], names: list[str], source: str | None, field: str
) -> dict[str, Value]:
    """The value for each name that is a key of ``patterns`` or matches one (shell wildcards).

    An exact name wins over a pattern, an earlier pattern over a later.

    Raises:
        ConfigError: a pattern matches no name.
    """
    matched: dict[str, Value] = {}
    for pattern in sorted(patterns, key=lambda key: key not in names):  # exact names first
        hits = [pattern] if pattern in names else [n for n in names if fnmatchcase(n, pattern)]
        if not hits:
            raise ConfigError(
                f"no joint is called {shown(pattern)}", source=source, field=field, choices=names
            )
        for name in hits:
            matched.setdefault(name, patterns[pattern])
    return matched
