"""Solvers by name."""

from __future__ import annotations

import dataclasses
from importlib import import_module

from poise.configs.errors import ConfigError, shown
from poise.configs.schema import build

from .problem import Solver

#: Name → module, class of the solver, class of its options. Imported when first used.
SOLVERS = {
    "active-set": ("active_set", "ActiveSetSolver", "ActiveSetOptions"),
    "daqp": ("daqp", "DAQPSolver", "DAQPOptions"),
    "osqp": ("osqp", "OSQPSolver", "OSQPOptions"),
}


def make_solver(name: str, **options: object) -> Solver:
    """A solver by its name; `options` are the fields of its options class.

    A whole float is taken for an int, 0 and 1 for a bool: configurations hold plain numbers.

    Raises:
        ConfigError: an unknown name or option, or a value that is not valid.
    """
    if name not in SOLVERS:
        raise ConfigError(f"unknown solver {shown(name)}", field="solver", choices=SOLVERS)
    module_name, solver_class, options_class = SOLVERS[name]
    module = import_module(f".{module_name}", __package__)
    cls = getattr(module, options_class)
    defaults = {option.name: option.default for option in dataclasses.fields(cls)}
    plain = {key: _like(defaults.get(key), value) for key, value in options.items()}
    return getattr(module, solver_class)(build(cls, plain, f"solver {name}"))


def _like(default: object, value: object) -> object:
    """The number in the type of the default, where that loses nothing."""
    if isinstance(default, bool) and not isinstance(value, bool) and value in (0, 1):
        return bool(value)
    if type(default) is int and isinstance(value, float) and value.is_integer():
        return int(value)
    return value
