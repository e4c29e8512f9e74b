"""A guessed description as a file, for its owner to correct."""

import os
from pathlib import Path

import yaml

from poise.configs.files import resolve, write_atomic
from poise.configs.reading import exists
from poise.configs.schema import build, to_dict
from poise.envs.robots.description import FootDescription, RobotDescription, SourceDescription
from poise.envs.robots.guess import MODELS, guess, robot_name
from poise.envs.robots.robot import Robot, load_robot

NOTHING = {"source": SourceDescription(builder="humanoid"), "name": "", "root": "",
           "feet": (FootDescription("a", "a"), FootDescription("b", "b"))}  # fmt: skip
HEAD = "# Guessed by poise robot from {path}: correct what is wrong; all fields: docs/robots.md\n"


def load_and_write(name: str) -> tuple[Robot, Path | None]:
    """Return the robot of a name, and the file of its description that was written for it, if any.

    A model without a description gets one in the current folder, under the model's name, unless
    that file exists: it may have been edited. An error then names what is missing in it, such as
    torque limits. The file has every value that is not the default, and the model's path relative
    to its own folder: the two can be moved together.

    Raises ConfigError as `load_robot` and `guess`.
    """
    model, path = Path(name), Path(f"{robot_name(Path(name))}.yaml")
    if model.suffix.lower() not in MODELS or exists(path):
        return load_robot(name), None
    description = guess(resolve("robots", name))
    plain = to_dict(RobotDescription(**NOTHING))  # type: ignore[arg-type]
    fields = to_dict(description)
    kept = {name: value for name, value in fields.items() if value != plain.get(name)}
    relative = os.path.relpath(model, path.parent)
    kept["source"] = {kind: relative for kind, file in fields["source"].items()
                      if kind in ("mjcf", "urdf") and file}  # fmt: skip
    for part in ("posture", "options"):
        own = {name: value for name, value in fields[part].items() if value != plain[part][name]}
        kept |= {part: own} if own else {}
    build(RobotDescription, kept, path)
    text = yaml.safe_dump(kept, sort_keys=False, default_flow_style=None, width=100,
                          allow_unicode=True)  # fmt: skip
    write_atomic(path, HEAD.format(path=model.name) + text)
    return load_robot(path), path
