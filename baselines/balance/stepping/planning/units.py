"""Numbers of a configuration in units of the robot, and what they are in SI units."""

from dataclasses import field, fields
from typing import Any, Literal

import numpy as np

from poise.envs.compiled.maths.pendulum import Units

Unit = Literal["", "h", "1/h", "1/ω", "h ω", "h ω²", "ω²", "ω/(m g)", "°"]


def number(default: float, unit: Unit = "", **bounds: Any) -> float:
    """A field with this default, its unit as of `in_si` and bounds as of `schema.build`."""
    return field(default=default, metadata={"unit": unit, **bounds})


def in_si(config: Any, units: Units, *names: str) -> dict[str, Any]:
    """Return the numbers of a configuration that are named, in SI units, by the same names.

    Raises KeyError for a name that the configuration does not have.
    """
    found: dict[str, Any] = {}
    h, omega = units.height, units.omega
    known = {item.name: item for item in fields(config)}
    for name in names:
        item = known[name]
        value = getattr(config, name)
        match item.metadata.get("unit", ""):
            case "h":
                value = value * h
            case "1/h":
                value = value / h
            case "1/ω":
                value = value / omega
            case "h ω":
                value = value * h * omega
            case "h ω²":
                value = value * h * omega**2
            case "ω²":
                value = value * omega**2
            case "ω/(m g)":
                value = value * omega / units.force
            case "°":
                value = np.radians(value)
        found[name] = float(value)
    return found
