"""What a file leaves open: which axis is up, which way it faces, how long its unit is."""

from dataclasses import dataclass

import numpy as np

from poise.configs.errors import ConfigError, shown

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "inch": 0.0254, "dm": 0.1}
AXES = ("x", "-x", "y", "-y", "z", "-z")
LEGS = (0.5, 1.2)  # [m] thigh and shank of a person
ADULT = (0.65, 1.0)  # [m] the same for units that are not usual, and characters have any size
USUAL = ("m", "cm")
LEG = 0.8  # [m] what they become if the unit is none of these


@dataclass(frozen=True, eq=False)
class FileAxes:
    """How a file's vectors become those of a clip: world = unit · matrix · file.

    Attributes:
        matrix: (3, 3) a rotation by right angles; its rows are the file's forward, left and up.
        unit: length of the file's unit [m].
    """

    matrix: np.ndarray
    unit: float

    def places(self, file: np.ndarray) -> np.ndarray:
        """Vectors (…, 3) of the file in the world [m]."""
        return self.unit * file @ self.matrix.T

    def file_places(self, world: np.ndarray) -> np.ndarray:
        """Vectors (…, 3) of the world [m] as the file has them."""
        return world @ self.matrix / self.unit

    def turns(self, file: np.ndarray) -> np.ndarray:
        """Quaternions (…, 4) of the file, about the world's axes."""
        return np.concatenate([file[..., :1], file[..., 1:] @ self.matrix.T], axis=-1)

    def file_turns(self, world: np.ndarray) -> np.ndarray:
        """Quaternions (…, 4) of the world, about the file's axes."""
        return np.concatenate([world[..., :1], world[..., 1:] @ self.matrix], axis=-1)

    @property
    def names(self) -> tuple[str, str]:
        """(up, forward), such as ("y", "z")."""
        return nearest_axis(self.matrix[2]), nearest_axis(self.matrix[0])


def named_axes(up: str, forward: str, unit: float = 1.0, source: str | None = None) -> FileAxes:
    """The axes of a file whose `up` and `forward` are named, such as ``y`` and ``z``.

    Raises:
        ConfigError: no such axis, or both on one line.
    """
    u, f = _vector(up, "up", source), _vector(forward, "forward", source)
    if u @ f:
        raise ConfigError(f"up ({up}) and forward ({forward}) are on one line", source=source,
                          field="forward", choices=AXES)  # fmt: skip
    return FileAxes(np.stack([f, np.cross(u, f), u]), unit)


def nearest_axis(vector: np.ndarray) -> str:
    """The signed axis that a vector (3,) is nearest to."""
    axis = int(np.argmax(np.abs(vector)))
    return ("-" if vector[axis] < 0 else "") + "xyz"[axis]


def unit_from_legs(length: float) -> float:
    """Length of the unit [m] in which legs of a person are `length` long.

    The one of `UNITS` in which legs are then as long as a person's, at most one, else what makes
    them 0.8 m.
    """
    for name, metres in UNITS.items():
        least, most = LEGS if name in USUAL else ADULT
        if least <= length * metres <= most:
            return metres
    return LEG / length


def named_unit(unit: str, source: str | None = None) -> float:
    """The length [m] of a unit's name, or of a number; raises ConfigError for another text."""
    if unit in UNITS:
        return UNITS[unit]
    try:
        length = float(unit)
    except ValueError:
        length = 0.0
    if not 0.0 < length < 1e6:
        raise ConfigError(f"no such unit: {shown(unit)}", source=source, field="unit",
                          choices=(*UNITS, "auto", "a length in metres"))  # fmt: skip
    return length


def _vector(name: str, field: str, source: str | None) -> np.ndarray:
    if name not in AXES:
        raise ConfigError(f"no such axis: {shown(name)}", source=source, field=field, choices=AXES)
    vector = np.zeros(3)
    vector["xyz".index(name[-1])] = -1.0 if name.startswith("-") else 1.0
    return vector
