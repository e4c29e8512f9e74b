"""A guessed description as a file, for its owner to correct."""

from __future__ import annotations

from pathlib import Path

import yaml

from poise.configs.errors import ConfigError
from poise.configs.files import write_atomic
from poise.configs.reading import exists
from poise.configs.schema import build, to_dict
from poise.envs.robots.description import FootDescription, RobotDescription, SourceDescription
from poise.envs.robots.guess import MODELS
from poise.envs.robots.robot import Robot

NOTHING = {"source": SourceDescription(builder="humanoid"), "name": "", "root": "",
           "feet": (FootDescription("a", "a"), FootDescription("b", "b"))}  # fmt: skip
HEAD = "# Guessed by poise robot from {path}: correct what is wrong; all fields: docs/robots.md\n"


def is_guessed(robot: Robot) -> bool:
    """Whether the robot was loaded from its model alone."""
    return Path(robot.source).suffix.lower() in MODELS


def write_description(robot: Robot, path: Path) -> None:
    """Write the description of a guessed robot, what is not the default, with the model's path.

    Raises ConfigError where there is such a file already: it may be somebody's work.
    """
    if exists(path):
        raise ConfigError("is there already, and is not written over", source=path)
    model = Path(robot.source).absolute()
    plain = to_dict(RobotDescription(**NOTHING))  # type: ignore[arg-type]
    fields = to_dict(robot.description)
    kept = {name: value for name, value in fields.items() if value != plain.get(name)}
    kept["source"] = {kind: str(model) for kind, file in fields["source"].items()
                      if kind in ("mjcf", "urdf") and file}  # fmt: skip
    posture = {name: value for name, value in fields["posture"].items()
               if value != plain["posture"][name]}  # fmt: skip
    kept["posture"] = posture
    build(RobotDescription, kept, path)
    text = yaml.safe_dump(kept, sort_keys=False, default_flow_style=None, width=100,
                          allow_unicode=True)  # fmt: skip
    write_atomic(path, HEAD.format(path=model.name) + text)
