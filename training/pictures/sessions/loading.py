"""Build a session from its settings in text."""

import re
from collections.abc import Callable
from pathlib import Path

import yaml

from poise.baselines.balance.references.motion import load_motion
from poise.baselines.balance.references.robot_clip import check_clip_robot, read_robot_clip
from poise.baselines.extras import load_extra
from poise.baselines.walking.schedule import parse_commands
from poise.configs.errors import ConfigError, shown
from poise.configs.yaml_loader import Loader
from poise.envs.physics.pushes.options import parse_pushes
from poise.envs.physics.pushes.push import Push
from poise.envs.physics.pushes.sampler import push_bodies
from poise.envs.robots.robot import Robot, load_robot

from .live import Live
from .session import load_session
from .spec import STANDING, SessionSpec

SHORT = re.compile(r"(?P<impulse>[^@{]+)@(?P<direction>[^@]+)(?:@(?P<start>[^@]+))?")


def load_live(spec: SessionSpec, say: Callable[[str], object] = lambda line: None) -> Live:
    """Return the session that `spec` asks for, at its start.

    Raises ConfigError for what is not valid; nothing that takes long has been done then, unless it
    is a controller itself. `say` is given a line before the controllers are loaded.
    """
    robot = load_robot(spec.robot)
    pushes = [push for text in spec.pushes for push in read_pushes(text, robot)]
    commands = parse_commands([read_mapping(text, "command") for text in spec.commands], "command")
    motion, seen = None, None
    if (
        Path(spec.motion).suffix == ".npz"
        and (clip := read_robot_clip(spec.motion)).about.unperformed
    ):
        check_clip_robot(clip, robot, spec.motion)
        seen = clip
    elif spec.motion != STANDING:
        motion = load_motion(spec.motion, robot)
        load_extra("motions", "performer", f"the motion {motion.name!r}")  # before all that waits
    say(f"loading {', '.join(spec.controllers)}")
    session = load_session(
        spec.controllers, robot, spec.seed, pushes, commands=commands, motion=motion,
        realism=spec.realism,
    )  # fmt: skip
    return Live(session, spec, motion, seen)


def read_pushes(text: str, robot: Robot) -> list[Push]:
    """Return the pushes of a flag `--push`; raises ConfigError for what is none.

    That is impulse [N·s] @ direction [deg] and, if not at 1 s, @ start [s], of the robot's first
    push body, such as 20@90@1.5; or a YAML mapping with the fields of a push.
    """
    if found := SHORT.fullmatch(text.strip()):
        texts = {name: value for name, value in found.groupdict("1").items()}
        try:
            fields: object = {**{name: float(value) for name, value in texts.items()},
                              "body": push_bodies(robot)[0]}  # fmt: skip
        except ValueError:
            raise ConfigError(f"must be such as 20@90 or 20@90@1.5, not {shown(text)}",
                              field="push") from None  # fmt: skip
    else:
        fields = read_mapping(text, "push")
    parsed = parse_pushes(fields, robot)
    pushes = [push for push in parsed if isinstance(push, Push)]
    if len(pushes) != len(parsed):
        raise ConfigError("a kick (delta_v) is no push of a trial; give an impulse", field="push")
    return pushes


def read_mapping(text: str, field: str) -> object:
    """What a flag says in YAML; raises ConfigError for what is no YAML."""
    try:
        return yaml.load(text, Loader=Loader)
    except yaml.YAMLError:
        raise ConfigError(f"is no YAML mapping: {shown(text)}", field=field) from None
