"""Numbers of a configuration in units of the robot, and what they are in SI units."""

from dataclasses import field, fields
from typing import Any, Literal, get_type_hints

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.maths.pendulum import Units

Unit = Literal["", "h", "1/h", "1/ω", "h ω", "h ω²", "ω²", "ω/(m g)", "°"]


def number(default: float, unit: Unit = "", **bounds: Any) -> float:
    """A field with this default, its unit as of `in_si` and bounds as of `schema.build`."""
    return field(default=default, metadata={"unit": unit, **bounds})


def in_si(block: type[Block], config: Any, units: Units) -> dict[str, Any]:
    """Those numbers of a configuration that a block has under the same names, in SI units."""
    found: dict[str, Any] = {}
    h, omega = units.height, units.omega
    names = {name for name, kind in get_type_hints(block).items() if kind is float}
    for item in fields(config):
        if item.name not in names:
            continue
        value = getattr(config, item.name)
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
        found[item.name] = float(value)
    return found
