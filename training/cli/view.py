"""The sub-command `view`: the robot in the browser or in a window, live or from a result."""

from pathlib import Path
from typing import Annotated

import tyro

from poise.configs.errors import ConfigError
from poise.training.running.options.arguments import Allow, OnRobot, Switch, check_folders

Shown = Annotated[
    tuple[str, ...],
    tyro.conf.Positional,
    tyro.conf.arg(metavar="CONTROLLER … | DIR", help_behavior_hint=""),
]
Pushes = Annotated[
    tuple[str, ...],
    tyro.conf.UseAppendAction,
    tyro.conf.arg(
        metavar="PUSH",
        help="A push that is known beforehand: 20@90 [N·s, degrees from ahead to the left] at 1 s, "
        "20@90@1.5 at 1.5 s, or with all its fields '{impulse: 20, direction: 90, body: torso, "
        "duration: 0.1, start: 1}'; repeatable.",
    ),
]

Commands = Annotated[
    tuple[str, ...],
    tyro.conf.UseAppendAction,
    tyro.conf.arg(
        metavar="COMMAND",
        help="Command to a controller that walks, such as '{ahead: 0.6, left: 0, turn: 0.2, "
        "start: 1}' in m/s, rad/s and s; repeatable.",
    ),
]


def view(
    shown: Shown = (),
    /,
    *,
    robot: OnRobot = "humanoid",
    motion: str = "standing",
    host: str = "127.0.0.1",
    port: int = 8080,
    seed: int = 0,
    push: Pushes = (),
    command: Commands = (),
    realism: str = "ideal",
    trial: int | None = None,
    controllers: tuple[str, ...] = (),
    native: Switch = False,
    seconds: float | None = None,
    dark: Switch = False,
    allow: Allow = (),
) -> None:
    """Show the robot in the browser, in real time, to be pushed; or a trial of a result.

    Up to three controllers stand side by side and get the same pushes: by a button, or by dragging
    a body with the mouse. With --trial it is a trial of the result in DIR, with a timeline.
    Needs poise[view], but for --native.

    Args:
        shown: controllers, feedback-step if not given; with --trial, a folder written by poise
            evaluate or poise benchmark.
        motion: motion to perform: a name, a .yaml, or a .npz of poise motion import.
        host: address to serve at; the default is reachable from this machine only.
        port: port of the page; 0 is any that is free.
        seed: seed of the slightly disturbed start.
        realism: realism level: ideal, lab, field, or a .yaml file.
        trial: number of a trial in trials.csv.
        controllers: with --trial, up to three of the evaluated controllers; the last if not given.
        native: show one controller in MuJoCo's own window; needs a display.
        seconds: end after this time and print the real-time factor.
        dark: show a dark page.
    """
    from poise.envs.viewing.gl import choose_gl_backend

    choose_gl_backend()
    from poise.training.benchmarking.trials.names import check_names

    if trial is None:
        check_names(shown, robot=robot, motion=motion, realism=realism)
    else:
        check_folders(*shown)
    from poise.training.pictures.view.view import view, view_trial

    if trial is None:
        if controllers:
            raise ConfigError("goes with --trial; without it, controllers stand before the flags",
                              field="controllers")  # fmt: skip
        view(
            shown, robot=robot, motion=motion, host=host, port=port, seed=seed, pushes=push,
            commands=command, realism=realism, native=native, seconds=seconds, dark=dark,
            allow=allow,
        )  # fmt: skip
        return
    if len(shown) != 1:
        raise ConfigError("goes with one folder of a result", field="trial")
    if native:
        raise ConfigError("shows no recorded trial: leave out --trial or --native", field="native")
    view_trial(
        Path(shown[0]), trial, controllers, host=host, port=port, seconds=seconds, dark=dark,
        allow=allow,
    )  # fmt: skip
