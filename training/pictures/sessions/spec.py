"""What is to be shown, in text: the command and the link that show the same again, and the names
that may stand in a link."""

import shlex
from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import NamedTuple
from urllib.parse import parse_qs, urlencode

from poise.baselines.allowance import named
from poise.baselines.policy_files.known import RIVALS
from poise.configs.errors import ConfigError, shown
from poise.configs.files import packaged
from poise.envs.sensing.realism import IDEAL
from poise.training.benchmarking.trials.names import NO_CONTROL

STANDING = "standing"  # the motion of a session that names none
MOST = 3  # controllers side by side
NO_CONTROLLER = "none"


@dataclass(frozen=True)
class SessionSpec:
    """A session: who plays what, from which start, with which pushes and commands.

    Attributes:
        controllers, robot, motion: names and paths, as a user writes them.
        seed: of the disturbed start.
        realism: a packaged level or a path to one.
        pushes, commands: YAML mappings, as `parse_pushes` and `parse_commands` take them.
        allow: what may run though only a file names it.
    """

    controllers: tuple[str, ...]
    robot: str = "humanoid"
    motion: str = STANDING
    seed: int = 0
    pushes: tuple[str, ...] = ()
    commands: tuple[str, ...] = ()
    realism: str = IDEAL
    allow: tuple[str, ...] = ()

    @property
    def command(self) -> str:
        """The command line that plays the same."""
        words = ["poise", "view", *self.controllers, "--robot", self.robot]
        if self.motion != STANDING:
            words += ["--motion", self.motion]
        if self.realism != IDEAL:
            words += ["--realism", self.realism]
        words += ["--seed", str(self.seed)]
        words += [word for text in self.pushes for word in ("--push", text)]
        words += [word for text in self.commands for word in ("--command", text)]
        return shlex.join(words + [word for name in self.allow for word in ("--allow", name)])

    @property
    def link(self) -> str:
        """The address that plays the same, without the server's."""
        fields = {"controller": self.controllers, "robot": self.robot, "motion": self.motion,
                  "seed": self.seed, "push": self.pushes, "command": self.commands}  # fmt: skip
        return "/?" + urlencode(fields, doseq=True)


@dataclass(frozen=True)
class TrialSpec:
    """A trial of a result in a folder, by some of the controllers that took part.

    Attributes:
        folder, trial, controllers: as a user writes them.
        allow: what may run though only a file names it.
    """

    folder: str
    trial: int
    controllers: tuple[str, ...]
    allow: tuple[str, ...] = ()

    @property
    def command(self) -> str:
        """The command line that shows the same."""
        words = ["poise", "view", self.folder, "--trial", str(self.trial)]
        names = dict.fromkeys([*named(*self.controllers), *self.allow])
        allowed = [word for name in names for word in ("--allow", name)]
        return shlex.join([*words, "--controllers", *self.controllers, *allowed])

    @property
    def link(self) -> str:
        """The address that shows the same where this folder is shown, without the server's."""
        return "/?" + urlencode({"trial": self.trial, "controller": self.controllers}, doseq=True)


Spec = SessionSpec | TrialSpec


class Choices(NamedTuple):
    """The names of each kind that can be chosen on the page, or by a link.

    Nothing that is a path or code, but for what the user has named on the command line.
    """

    robots: tuple[str, ...]
    controllers: tuple[str, ...]
    motions: tuple[str, ...]

    @property
    def all(self) -> tuple[str, ...]:
        """Names of any kind."""
        return (*self.robots, *self.controllers, *self.motions)


def choices(named: Spec) -> Choices:
    """What is packaged, no control at all, and what the user has named."""
    players = (*packaged("controllers"), *packaged("policies"), *packaged(RIVALS), NO_CONTROL)
    robots, motions = tuple(packaged("robots")), tuple(packaged("motions"))
    if not isinstance(named, SessionSpec):
        return Choices(robots, players, motions)
    return Choices(
        _with(robots, named.robot),
        _with(players, *named.controllers),
        _with(motions, named.motion),
    )


def _with(names: tuple[str, ...], *more: str) -> tuple[str, ...]:
    return tuple(dict.fromkeys((*names, *more)))


def read_link(query: str, now: Spec, names: Collection[str]) -> Spec | None:
    """What a link asks for; None where it asks for nothing.

    Args:
        query: of the address, what stands behind its question mark.
        now: what is shown; what the link leaves open stays as it is there, but for pushes and
            commands.
        names: of robots, controllers and motions that a link may name.

    Raises:
        ConfigError: a name that is not among them, more than three controllers, a number that is
            none.
    """
    given = parse_qs(query)
    controllers = tuple(given.get("controller", now.controllers))
    if len(controllers) > MOST:
        raise ConfigError(f"at most {MOST} side by side, not {len(controllers)}",
                          field="controller")  # fmt: skip
    if isinstance(now, TrialSpec):
        if "trial" not in given:
            return None
        trial = _number(given["trial"][-1], "trial")
        return replace(now, trial=trial, controllers=controllers)
    known = ("controller", "robot", "motion", "seed", "push", "command")
    if not any(name in given for name in known):
        return None
    spec = replace(
        now,
        controllers=controllers,
        robot=given.get("robot", [now.robot])[-1],
        motion=given.get("motion", [STANDING])[-1],
        seed=_number(given.get("seed", ["0"])[-1], "seed"),
        pushes=tuple(given.get("push", ())),
        commands=tuple(given.get("command", ())),
    )
    for name in (*spec.controllers, spec.robot, spec.motion):
        if name not in names:
            raise ConfigError(f"a link may name what is packaged alone, not {shown(name)}")
    return spec


def _number(text: str, field: str) -> int:
    """Return a whole number of at most nine digits."""
    if not (text.isascii() and text.isdigit() and len(text) < 10):
        raise ConfigError(f"must be a whole number, not {shown(text)}", field=field)
    return int(text)
