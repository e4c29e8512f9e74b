"""Which engine steps a robot, and its settings of contact: `configs/physics/*.yaml`."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, Final, Literal

from poise.configs.errors import ConfigError, shown
from poise.configs.files import resolve
from poise.configs.schema import build, read_yaml, to_dict

MUJOCO: Final = "mujoco"
DRAKE: Final = "drake"
#: engine → the module that it needs, and how to get it
NEEDS = {DRAKE: ("pydrake", "pip install 'poise[drake]', or pip install --no-deps drake")}


@dataclass(frozen=True)
class Physics:
    """The engine that steps a robot. All fields but `engine` are of Drake alone.

    MuJoCo's own options are those of the robot's description (docs/robots.md).

    Attributes:
        engine: What steps the robot.
        substeps: Steps of the engine in a physics step, in which torques and pushes are constant.
        contact: Drake's approximation of compliant contact. `lagged` bounds friction by the normal
            force at the start of a step; `sap` lifts points that slide.
        sink: Depth to which the robot's weight presses a single point of contact [m]; it sets the
            stiffness of a point.
        dissipation: Hunt and Crossley's, of `lagged`: the force k x of a point at depth x is
            k x (1 + dissipation ẋ) [s/m].
        slip: Speed below which friction of `lagged` is viscous [m/s].
        relaxation: Time constant of the dissipation of `sap` [s].
    """

    engine: Literal["mujoco", "drake"] = MUJOCO
    substeps: int = field(default=2, metadata={"min": 1, "max": 100})
    contact: Literal["lagged", "sap"] = "lagged"
    sink: float = field(default=4e-3, metadata={"above": 0.0, "max": 0.1})
    dissipation: float = field(default=28.0, metadata={"min": 0.0, "max": 1e3})
    slip: float = field(default=1e-4, metadata={"above": 0.0, "max": 0.1})
    relaxation: float = field(default=0.01, metadata={"min": 0.0, "max": 1.0})

    def __post_init__(self) -> None:
        changed = [f.name for f in fields(self)[1:] if getattr(self, f.name) != f.default]
        if self.engine == MUJOCO and changed:
            raise ValueError(f"{changed[0]}: is of drake; MuJoCo's options are the robot's")

    @staticmethod
    def named(name: str) -> Physics:
        """The settings that a configuration names, see `load_physics`."""
        return load_physics(name)


def load_physics(given: str | Path | Mapping | Physics | None, source: str = "physics") -> Physics:
    """Settings by a packaged name (``mujoco``, ``drake``), a .yaml file, or a mapping.

    Raises ConfigError naming the file, the field and the choices; for an engine that is not
    installed, what installs it.
    """
    if isinstance(given, Physics) or given is None:
        return _installed(given or Physics(), source)
    if isinstance(given, (str, Path)):
        path = resolve("physics", given)
        data, source = read_yaml(path), str(path)
    elif isinstance(given, Mapping):
        data = to_dict(dict(given))
    else:
        raise ConfigError(
            f"must be the name of an engine, a file or a mapping, not {shown(given)}",
            field=source, choices=Physics.__dataclass_fields__,
        )  # fmt: skip
    physics: Any = build(Physics, data, source)
    return _installed(physics, source)


def _installed(physics: Physics, source: str) -> Physics:
    module, advice = NEEDS.get(physics.engine, ("mujoco", ""))
    if importlib.util.find_spec(module) is None:
        raise ConfigError(f"{physics.engine} is not installed: {advice}", source=source,
                          field="engine")  # fmt: skip
    return physics
