"""Controllers by name: `configs/controllers/*.yaml`, or a path to such a file."""

from collections.abc import Mapping
from pathlib import Path

from poise.baselines.balance.in_place.capture_point import CapturePoint, CapturePointConfig
from poise.baselines.balance.in_place.get_up import GetUp, GetUpConfig
from poise.baselines.balance.in_place.jacobian_transpose import (
    JacobianTranspose,
    JacobianTransposeConfig,
)
from poise.baselines.balance.in_place.kudoh02 import Kudoh02, Kudoh02Config
from poise.baselines.balance.in_place.lip_mpc import LIPMPC, LIPMPCConfig
from poise.baselines.balance.in_place.lqr_lip import LQRLIP, LQRLIPConfig
from poise.baselines.balance.in_place.macchietto09 import Macchietto09, Macchietto09Config
from poise.baselines.balance.in_place.pd import PD, PDConfig, StablePD, StablePDConfig
from poise.baselines.balance.stepping.capture_step import CaptureStep
from poise.baselines.balance.stepping.ipm_step import IPMStep
from poise.baselines.balance.stepping.planning.config import CaptureStepConfig, IPMStepConfig
from poise.baselines.policy_files.config import PolicyFileConfig
from poise.baselines.policy_files.controller import PolicyFile
from poise.baselines.policy_files.known import RIVALS
from poise.baselines.policy_files.reading import is_policy, policy_config, policy_file_config
from poise.baselines.walking.config import WalkConfig
from poise.baselines.walking.simbicon import Simbicon, SimbiconConfig
from poise.baselines.walking.walk import Walk
from poise.baselines.whole_body.gains import MomentumQPConfig
from poise.baselines.whole_body.momentum_qp import MomentumQP
from poise.configs.errors import ConfigError, shown
from poise.configs.files import packaged, resolve
from poise.configs.schema import build, on_base, read_yaml
from poise.envs.robots.robot import Robot
from poise.envs.sensing.realism import Realism

from .allowance import is_plugin
from .controller import Controller
from .extras import load_extra, missing_extra, registered
from .plugins import PluginConfig, PluginController, plugin_config

#: The configuration of a controller of this package, or of one from outside.
ControllerConfig = (
    MomentumQPConfig | PDConfig | StablePDConfig | JacobianTransposeConfig | Kudoh02Config
    | Macchietto09Config | CapturePointConfig | LQRLIPConfig | LIPMPCConfig | PluginConfig
    | CaptureStepConfig | IPMStepConfig | WalkConfig | SimbiconConfig | PolicyFileConfig
    | GetUpConfig
)  # fmt: skip

#: `kind` → its configuration and its controller, which takes (robot, configuration). Extras add
#: further ones by entry points of the group ``poise.controllers``, see `kinds`.
KINDS: dict[str, tuple[type, type]] = {
    "momentum-qp": (MomentumQPConfig, MomentumQP),
    "pd": (PDConfig, PD),
    "stable-pd": (StablePDConfig, StablePD),
    "jacobian-transpose": (JacobianTransposeConfig, JacobianTranspose),
    "get-up": (GetUpConfig, GetUp),
    "kudoh02": (Kudoh02Config, Kudoh02),
    "macchietto09": (Macchietto09Config, Macchietto09),
    "capture-point": (CapturePointConfig, CapturePoint),
    "lqr-lip": (LQRLIPConfig, LQRLIP),
    "lip-mpc": (LIPMPCConfig, LIPMPC),
    "outside": (PluginConfig, PluginController),
    "capture-step": (CaptureStepConfig, CaptureStep),
    "ipm-step": (IPMStepConfig, IPMStep),
    "walk": (WalkConfig, Walk),
    "simbicon": (SimbiconConfig, Simbicon),
    "policy-file": (PolicyFileConfig, PolicyFile),
}

MOTION_STEP = "motion-step"  # the kind that poise[motion] adds, which packaged files have


def controller_config(controller: str | Path | Mapping[str, object]) -> ControllerConfig:
    """The configuration in a packaged file, a path or a mapping, of the class of its `kind`.

    ``module:Class`` is one from outside. An ONNX file, and a folder with one or with a
    ``deploy.yaml``, is a learned policy, see `PolicyFileConfig`.

    Raises ConfigError naming the file, the field and the choices; and for one from outside that the
    user has not allowed, see `allowing`.
    """
    config = _described(controller)
    if isinstance(config, PluginConfig):  # with the hash of what is there now
        return plugin_config(config.name, config.arguments)
    return config


def is_replaced(config: object, level: Realism) -> bool:
    """Whether another controller takes the place of this one at a level, see `where_uncertain`."""
    if not isinstance(config, CaptureStepConfig) or config.uncertain is None:
        return False
    return level.uncertain and level.misplaced >= config.uncertain_from


def where_uncertain(config: object, source: str = "controller") -> CaptureStepConfig | None:
    """The configuration that takes the place of this one where state and robot are uncertain.

    None where it stays. Raises ConfigError for one that does not exist, is of another kind, or is
    to be replaced itself.
    """
    if not isinstance(config, CaptureStepConfig) or config.uncertain is None:
        return None
    try:
        path = resolve("controllers", config.uncertain)
    except ConfigError as error:
        raise ConfigError(
            error.message, source=source, field="uncertain", choices=error.choices
        ) from None
    data = read_yaml(path)
    further = data.pop("uncertain", None)
    other = _build(data, str(path))
    if further is None and isinstance(other, CaptureStepConfig) and type(other) is type(config):
        return other
    wrong = f"is of kind {other.kind!r}, not {config.kind!r}"
    if further is not None:
        wrong = f"has an 'uncertain' of its own: {shown(further)}"
    raise ConfigError(f"{shown(config.uncertain)} {wrong}", source=source, field="uncertain")


def momentum_qp_config(name_or_path: str | Path) -> MomentumQPConfig:
    """`controller_config` where only a momentum QP will do; raises ConfigError for others."""
    config = _described(name_or_path)
    if not isinstance(config, MomentumQPConfig):
        raise ConfigError(
            f"{shown(str(name_or_path))} is of kind {config.kind!r}, not a momentum QP",
            field="controller",
            choices=_packaged("momentum-qp"),
        )
    return config


def walking_controllers(*, planners: bool = False) -> list[str]:
    """The packaged controllers that walk, or those of them that plan their steps."""
    return _packaged("walk") if planners else _packaged("walk", "simbicon")


def controller_kind(controller: object) -> str:
    """Return the kind of a controller, or the name of its class if it is of no kind here."""
    known = (kind for kind, (_, made) in KINDS.items() if type(controller) is made)
    return next(known, type(controller).__name__)


def performing_controllers() -> list[str]:
    """The packaged controllers that perform motions whose feet leave the ground."""
    return _packaged(MOTION_STEP)


def available_controllers() -> list[str]:
    """The packaged controllers whose extras are installed."""
    names = packaged("controllers")
    further = {name: _kind_of(name) for name in names if _kind_of(name) not in KINDS}
    return [
        name for name in names
        if name not in further or missing_extra("controllers", further[name]) is None
    ]  # fmt: skip


def _packaged(*kinds: str) -> list[str]:
    """The packaged controllers of these kinds."""
    return [name for name in packaged("controllers") if _kind_of(name) in kinds]


def _kind_of(name: str) -> str:
    """The kind of a packaged controller, which nothing is imported for."""
    path = resolve("controllers", name)
    return str(on_base(read_yaml(path), "controllers", str(path)).get("kind", "momentum-qp"))


def kinds() -> tuple[str, ...]:
    """All kinds of controllers, those of extras too, whether or not they are installed."""
    return tuple(dict.fromkeys([*KINDS, MOTION_STEP, *registered("controllers")]))


def kind_classes(kind: str) -> tuple[type, type]:
    """The configuration and the controller of a kind; raises MissingExtra, see `load_extra`."""
    classes: tuple[type, type] = KINDS.get(kind) or load_extra("controllers", kind)
    return classes


def load_controller(
    controller: str | Path | Mapping[str, object] | ControllerConfig | Controller, robot: Robot
) -> Controller:
    """A controller for `robot`: from a name, a path, a mapping or a configuration.

    Whatever has `period`, `reset` and `torques` (see `Controller`) is returned as it is.
    Raises ConfigError naming the file, the field and the choices; and for one from outside that the
    user has not allowed, see `allowing`.
    """
    if isinstance(controller, (str, Path, Mapping)):
        controller = controller_config(controller)
    kind = getattr(controller, "kind", None)
    if isinstance(kind, str) and kind in kinds():
        config_class, controller_class = kind_classes(kind)
        if type(controller) is config_class:
            return controller_class(robot, controller)
    if isinstance(controller, Controller):
        return controller
    raise ConfigError(
        f"must be a name, a .yaml file, a mapping or a controller, not {shown(controller)}",
        field="controller",
        choices=packaged("controllers"),
    )


def _described(controller: str | Path | Mapping[str, object]) -> ControllerConfig:
    """Return what a name, a file or a mapping says, without importing anything for it."""
    if isinstance(controller, Mapping):
        return _build(dict(controller), "controller")
    if is_plugin(controller):
        return PluginConfig(str(controller))
    if controller not in packaged("controllers") and is_policy(controller):
        return policy_config(controller)
    path = resolve("controllers", controller)
    return _build(read_yaml(path), str(path))


def _build(data: dict[str, object], source: str) -> ControllerConfig:
    """A configuration; `qp` may be the name of one of the momentum QP, or its mapping.

    `base` names a controller, or a public policy, whose fields hold where `data` has none of its
    own; within `qp` and `step_qp` one of the momentum QP.
    """
    of_policy = data.get("base") in packaged(RIVALS) and "kind" not in data
    bases = RIVALS if of_policy or data.get("kind") == "policy-file" else "controllers"
    not_given = {"uncertain", "uncertain_from"} - data.keys()
    data = on_base(data, bases, source, parts=("qp", "step_qp"))
    data = {name: value for name, value in data.items() if name not in not_given}
    kind = data.get("kind", "momentum-qp")
    known = kinds()
    if not isinstance(kind, str) or kind not in known:
        raise ConfigError(
            f"no such kind of controller: {shown(kind)}", source=source, field="kind", choices=known
        )
    if kind == "policy-file":
        return policy_file_config(data, Path(source))
    inner = data.get("qp")
    if isinstance(inner, str):
        data = {**data, "qp": read_yaml(resolve("controllers", inner))}
    config: ControllerConfig = build(kind_classes(kind)[0], data, source)
    where_uncertain(config, source)
    return config
