"""`poise walk`: one walk at a command, its figures, a video; `poise gait`: reference models of a
walk beside each other."""

import math
from pathlib import Path
from typing import Annotated

import tyro
import yaml

from poise.baselines.extras import load_extra
from poise.configs.errors import ConfigError, shown
from poise.training.running.options.arguments import Allow, OnRobot, Switch
from poise.training.running.terminal import terminal


def walk(
    *,
    speed: float = 0.5,
    left: float = 0.0,
    turn: float = 0.0,
    step_time: float | None = None,
    step_length: float | None = None,
    width: float | None = None,
    clearance: float | None = None,
    arm_swing: float | None = None,
    duration: float = 20.0,
    push: Annotated[str | None, tyro.conf.arg(metavar="PUSH")] = None,
    push_at: float = 6.0,
    seed: int = 0,
    robot: OnRobot = "humanoid",
    controller: str = "walk",
    terrain: Annotated[str, tyro.conf.arg(metavar="TERRAIN")] = "flat",
    realism: str | None = None,
    physics: str | None = None,
    video: Path | None = None,
    allow: Allow = (),
) -> int:
    """Walk at a commanded speed, pushed or not, and print speed, steps, cost and falls.

    Args:
        speed: commanded speed ahead [m/s]; below 0 backward.
        left: commanded speed to the left [m/s].
        turn: commanded turn to the left [deg/s].
        step_time: time from lift-off to touchdown [s]; by default the controller's own.
        step_length: length of a step [m], in place of the step time.
        width: distance between the soles [m]; by default the controller's own.
        clearance: largest height of the swinging sole [m]; by default the controller's own.
        arm_swing: amplitude of the arms against the legs [rad]; by default free to balance.
        duration: duration of the walk [s].
        push: an impulse [N·s] and a direction [deg, 0 ahead, 90 left] such as 20@90, for 0.1 s.
        push_at: time of the push [s].
        seed: seed of the slightly disturbed start.
        controller: a controller that walks: a name, a .yaml file, or a folder written by poise
            train.
        terrain: kind of terrain: flat, stairs, slope or stones, or with fields: "{kind: stairs,
            rise: 0.15}".
        realism: realism level: ideal, lab, field, or a .yaml file.
        physics: the engine that steps the robot: mujoco, drake, or a .yaml file of its settings.
        video: an MP4 or WebP file to write.

    Returns:
        0 if the robot is upright at the end, 1 if it fell.
    """
    if not 0.0 < duration < math.inf:
        raise ConfigError(f"must be above 0 and finite, not {duration:g}", field="duration")
    from poise.envs.viewing.gl import choose_gl_backend

    if video is not None:
        choose_gl_backend()
    from poise.training.benchmarking.trials.names import check_names

    check_names([controller], robot=robot, realism=realism, physics=physics)
    from poise.training.pictures.sessions.walk import play_walk

    command = {"ahead": speed, "left": left, "turn": math.radians(turn), "step_time": step_time,
               "step_length": step_length, "width": width, "clearance": clearance,
               "arm_swing": arm_swing}  # fmt: skip
    outcome = play_walk(
        command, duration=duration, controller=controller, robot=robot, terrain=_terrain(terrain),
        realism=realism, physics=physics, push=push, push_at=push_at, seed=seed, video=video,
        say=_say, allow=allow,
    )  # fmt: skip
    return 1 if outcome.fallen else 0


def _terrain(text: str) -> str | dict[str, object]:
    """Return a kind by its name, or the mapping that the text is as YAML.

    Raises ConfigError for text that is no YAML, or neither of these.
    """
    try:
        value = yaml.safe_load(text)
    except yaml.YAMLError:
        raise ConfigError(f"is no YAML: {shown(text)}", source="walk", field="terrain") from None
    return value if isinstance(value, dict) else text


def _say(line: str) -> None:
    print(line, flush=True)


def gait(
    *,
    compare: Annotated[tuple[str, ...], tyro.conf.arg(metavar="MODEL …")],
    out: Path,
    speeds: tuple[float, ...] = (0.5, 0.8),
    starts: int = 4,
    duration: float = 20.0,
    robot: OnRobot = "humanoid",
    seed: int = 21,
    human: str = "knee-moment",
    push: Switch = False,
    push_suite: str = "walk-push",
    workers: int | None = None,
    allow: Allow = (),
) -> None:
    """Compare how reference models walk: speed, cost, the stance knee beside a human's.

    Args:
        compare: reference models: lip, rigid, spring, double, or controllers that walk.
        out: folder to write gaits.json and stance_knee.png to.
        speeds: commanded speeds ahead [m/s].
        starts: walks at each speed, from slightly disturbed initial states.
        duration: duration of a walk [s].
        seed: seed of the starts.
        human: a packaged band of the human knee's moment or a .yaml file of one.
        push: also measure J50 with the suite walk-push at 0.5 m/s; takes over an hour.
        push_suite: another suite with a part walk_push, or a .yaml file of one.
        workers: number of processes of that suite; all cores if not given.
    """
    from poise.configs.files import resolve
    from poise.training.benchmarking.trials.names import check_names

    check_names(robot=robot, suite=push_suite)
    resolve("human", human)
    figures = load_extra("motions", "compare_gaits")(
        compare, out=out, speeds=speeds, starts=starts, duration=duration, robot=robot, seed=seed,
        human=human, pushed=push, push_suite=push_suite, workers=workers, say=_say, allow=allow,
    )  # fmt: skip
    load_extra("motions", "print_gaits")(figures, terminal())
    for name in ("gaits.json", "stance_knee.png"):
        print(out / name)
