"""`poise view`: what is named is checked, then loaded, then shown until the user ends it."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from pathlib import Path

import yaml

from poise.baselines.allowance import allows
from poise.configs.errors import ConfigError, shown
from poise.configs.files import resolve
from poise.configs.yaml_loader import Loader
from poise.envs.pushes.options import parse_pushes
from poise.envs.pushes.push import Push
from poise.envs.robots.robot import Robot, load_robot
from poise.training.sessions.live import Live, Play
from poise.training.sessions.recorded import recorded_trial
from poise.training.sessions.session import MOST, load_session
from poise.training.trials.agents import check_name

from .server import check_installed, check_port, greeting, serving

DEFAULT = "feedback-step"
Say = Callable[[str], object]


@allows("controllers")
def view(
    controllers: Sequence[str] = (),
    *,
    robot: str = "humanoid",
    host: str = "127.0.0.1",
    port: int = 8080,
    seed: int = 0,
    pushes: Sequence[str] = (),
    native: bool = False,
    seconds: float | None = None,
    dark: bool = False,
    allow: str | Iterable[str] = (),
    say: Say = print,
) -> float:
    """Show controllers side by side, which the user pushes; returns the real-time factor reached.

    Args:
        controllers: up to three names as `load_agent` takes them; none: `DEFAULT`.
        robot: a packaged robot or a path to its description.
        host, port: where the page is served; port 0 is any that is free.
        seed: of the start.
        pushes: scheduled ones, each a YAML mapping as `parse_pushes` takes it.
        native: MuJoCo's own window instead of a page, of one controller.
        seconds: of the wall clock after which it ends; None: when the process is stopped.
        dark: whether the page is dark.
        allow: controllers from outside that may run though only a file names them.
        say: is given what is to be told, line by line.

    Raises:
        ConfigError: anything named does not exist or is not valid; nothing has been loaded then.
        PoiseError: viser is not installed, or there is no display.
    """
    names = list(controllers) or [DEFAULT]
    _check(names, robot, seconds, native)
    if not native:
        check_port(host, port)
        check_installed()
    loaded = load_robot(robot)
    planned = [push for text in pushes for push in _read_pushes(text, loaded)]

    def load(robot: str | Robot, names: Sequence[str]) -> Live:
        model = robot if isinstance(robot, Robot) else load_robot(robot)
        known = planned if isinstance(robot, Robot) else []
        session = load_session(names, model, seed, known)
        where = model.name if isinstance(robot, str) else robot_name
        return Live(session, f"poise view {shlex.join(names)} --robot {where} --seed {seed}")

    robot_name = shlex.quote(robot)
    say(f"loading {', '.join(names)}")
    live = load(loaded, names)
    if native:
        from .native import run_native

        return run_native(live, seconds, say)
    return _serve(live, load, host, port, seconds, dark, say)


def view_trial(
    folder: str | Path,
    trial: int,
    controllers: Sequence[str] = (),
    *,
    host: str = "127.0.0.1",
    port: int = 8080,
    seconds: float | None = None,
    dark: bool = False,
    allow: str | Iterable[str] = (),
    say: Say = print,
) -> float:
    """Show a trial of a result, with a timeline; returns the real-time factor reached.

    Args:
        folder: written by `evaluate` or `benchmark`.
        trial: its number in trials.csv.
        controllers: up to three of those that took part; none: the last one.
        host, port, seconds, dark, allow, say: as of `view`.

    Raises:
        ConfigError, PoiseError: as `view` and `replay`.
    """
    _check_seconds(seconds)
    check_port(host, port)
    check_installed()
    play, lines = recorded_trial(Path(folder), trial, controllers, allow)
    for line in lines:
        say(line)
    return _serve(play, _not_here, host, port, seconds, dark, say)


def _check(names: Sequence[str], robot: str, seconds: float | None, native: bool) -> None:
    """Raises ConfigError for what is wrong with the names, before anything is compiled."""
    if len(names) > (1 if native else MOST):
        most = "one controller is shown by --native" if native else f"at most {MOST} side by side"
        raise ConfigError(f"{most}, not {len(names)}", field="controllers")
    _check_seconds(seconds)
    resolve("robots", robot)
    for name in names:
        check_name(name)


def _check_seconds(seconds: float | None) -> None:
    if seconds is not None and not seconds > 0.0:
        raise ConfigError(f"must be above 0, not {seconds}", field="seconds")


def _read_pushes(text: str, robot: Robot) -> list[Push]:
    """The pushes of a flag `--push`."""
    try:
        fields = yaml.load(text, Loader=Loader)
    except yaml.YAMLError:
        raise ConfigError(f"is no YAML mapping: {shown(text)}", field="push") from None
    parsed = parse_pushes(fields, robot)
    pushes = [push for push in parsed if isinstance(push, Push)]
    if len(pushes) != len(parsed):
        raise ConfigError("a kick (delta_v) is no push of a trial; give an impulse", field="push")
    return pushes


def _not_here(robot: str, names: Sequence[str]) -> Play:
    raise ConfigError("a recorded trial has its controllers")


def _serve(
    play: Play, load: Callable[[str, list[str]], Play], host: str, port: int,
    seconds: float | None, dark: bool, say: Say,
) -> float:  # fmt: skip
    from .browser import BrowserView

    with serving(host, port) as server:
        browser = BrowserView(server, play, load, dark)
        for line in greeting(host, server.get_port()):
            say(line)
        with suppress(KeyboardInterrupt):
            if seconds is None:
                say("Ctrl-C ends it")
            browser.run(seconds)
        say(f"{browser.pace.total:.3f} × real time over {browser.pace.wanted:.1f} s")
        return browser.pace.total
