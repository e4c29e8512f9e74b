"""Controllers and policies from outside this package, by `module:Class` or `file.py:Class`."""

import hashlib
import importlib
import importlib.util
import inspect
import os
import sys
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any, Literal

import numpy as np

from poise.configs.errors import ConfigError, PoiseError, raised
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot

from .allowance import NAME, allowing, check_allowed, is_plugin
from .controller import BaseController, Controller, Targets, WrappedController

METHODS = ("period", "reset", "torques")


@dataclass(frozen=True)
class PluginConfig:
    """`name` is ``module:Class`` or ``file.py:Class``, called with the robot and `arguments`.

    `source` is a hash of the file that the class is in, so that results tell versions apart; it is
    filled in by `plugin_config`. Whoever holds one may make its controller: what files say becomes
    one by `plugin_config` alone, which asks whether the user allows it.
    """

    name: str
    kind: Literal["outside"] = "outside"
    arguments: dict[str, Any] = field(default_factory=dict)
    source: str = ""


def plugin_config(name: str, arguments: dict[str, object] | None = None) -> PluginConfig:
    """The configuration of an external class; raises ConfigError where there is none."""
    found = find_plugin(name)
    try:
        path = inspect.getsourcefile(found)
    except TypeError:  # an object without a source
        path = None
    source = hashlib.sha256(Path(path).read_bytes()).hexdigest() if path else ""
    return PluginConfig(name, arguments=arguments or {}, source=source)


def find_plugin(name: str) -> Any:
    """Return what ``module:Class`` names; the current folder is searched for the module last.

    Nothing else in this package imports what a user or a file names. Raises ConfigError when the
    user has not allowed it (`allowing`), the module cannot be imported or lacks the name.
    """
    match = NAME.fullmatch(name)
    if match is None or not is_plugin(name):
        raise ConfigError(f"{name!r} is not of the form module:Class", field="controller")
    check_allowed(name)
    module = _module(match["place"])
    if not hasattr(module, match["name"]):
        public = [key for key in vars(module) if not key.startswith("_")]
        raise ConfigError(f"{match['place']!r} has no {match['name']!r}", field="controller",
                          choices=public)  # fmt: skip
    return getattr(module, match["name"])


def make_plugin(name: str, robot: Robot, arguments: dict[str, object] | None = None) -> object:
    """An instance for `robot`; raises ConfigError when it cannot be made."""
    try:
        return find_plugin(name)(robot, **(arguments or {}))
    except PoiseError:
        raise
    except Exception as error:
        raise ConfigError(
            f"cannot be made for the robot {robot.name!r}: {raised(error)}", source=name
        ) from error


class PluginController(WrappedController):
    """An external controller, whose torques are checked before they act.

    A wrong shape or a number that is not finite is an error: MuJoCo would act on zeros instead.
    A subclass of `BaseController` reports more than its torques.
    """

    def __init__(self, robot: Robot, config: PluginConfig):
        with allowing(config.name):
            inner = make_plugin(config.name, robot, config.arguments)
        if not isinstance(inner, Controller):
            missing = [name for name in METHODS if not hasattr(inner, name)]
            raise ConfigError(f"is no controller: it lacks {', '.join(missing)}",
                              source=config.name)  # fmt: skip
        super().__init__(inner, robot)
        self.robot, self.config = robot, config
        try:
            self.period = float(self.inner.period)
        except (TypeError, ValueError):
            self.period = float("nan")
        if not 0.0 < self.period <= 1.0:
            raise ConfigError(f"must be seconds, at most 1, not {self.inner.period!r}",
                              source=config.name, field="period")  # fmt: skip

    def __reduce__(self) -> tuple[object, ...]:
        return _blank, (type(self), self.config.name), self.__getstate__()

    def another(self) -> BaseController:
        """Return a new instance of the same class with the same arguments."""
        return type(self)(self.robot, self.config)

    def torques(self, state: RobotState, targets: Targets) -> np.ndarray:
        """Joint torques (nu,) [N·m]; raises PoiseError for any that are none."""
        tau = np.asarray(self.inner.torques(state, targets), dtype=float)
        expected = self.robot.torque_limit.shape
        if tau.shape != expected:
            raise PoiseError(f"{self.config.name}: torques have shape {tau.shape}, not {expected}")
        if not np.all(np.isfinite(tau)):
            raise PoiseError(f"{self.config.name}: torques are not finite")
        return tau


def _blank(kind: type[PluginController], name: str) -> PluginController:
    """A controller still without anything, once its module is there to find its class in.

    Whoever copied it had been allowed to make it, and to unpickle is to run code anyway: Poise
    itself unpickles nothing that it reads from a folder.
    """
    with allowing(name):
        find_plugin(name)
    return kind.__new__(kind)


def _module(place: str) -> ModuleType:
    """A module by its name, or by the path of its file."""
    try:
        if place.endswith(".py"):
            return _from_file(Path(place))
        return _by_name(place)
    except Exception as error:  # whatever the module itself raises
        raise ConfigError(f"{place!r} cannot be imported: {raised(error)}",
                          field="controller") from None  # fmt: skip


def _by_name(place: str) -> ModuleType:
    """The current folder comes last, and only where a module is there.

    What lies in it then never stands in for another library's module.
    """
    try:
        return importlib.import_module(place)
    except ModuleNotFoundError as error:
        here, top = os.getcwd(), place.partition(".")[0]
        if error.name != top or here in sys.path:
            raise
    sys.path.append(here)
    try:
        return importlib.import_module(place)
    except ModuleNotFoundError as error:
        if error.name == top:
            sys.path.remove(here)
        raise


def _from_file(path: Path) -> ModuleType:
    path = path.resolve()
    name = f"_poise_outside_{hashlib.sha256(str(path).encode()).hexdigest()[:16]}"
    if name not in sys.modules:
        spec = importlib.util.spec_from_file_location(name, path)
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module
        try:
            spec.loader.exec_module(module)
        except BaseException:
            del sys.modules[name]
            raise
    return sys.modules[name]
