"""`poise motion check` and `follow`: what a robot can do of a motion, and what it then does."""

import json
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import tyro

from poise.baselines.allowance import named
from poise.baselines.motion.synthesis.scripts.library import find_script, names_script
from poise.configs.errors import ConfigError
from poise.configs.files import packaged, write_atomic
from poise.configs.outputs import check_out_file
from poise.envs.robots.robot import load_robot
from poise.training.running.options.arguments import Allow, OnRobot, Switch
from poise.training.running.terminal import terminal


def check(
    motion: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="MOTION")],
    /,
    *,
    robot: OnRobot = "humanoid",
    qp: Switch = False,
    controller: str = "momentum-qp",
    fit: Switch = False,
    out: Path | None = None,
) -> int:
    """Check whether a robot can perform a motion: ground, motors and joints, at 100 Hz.

    Args:
        motion: a .npz of poise motion import, a packaged motion, or a .yaml of one.
        qp: also solve the momentum QP at every sample of the motion.
        controller: momentum QP that supplies the gains.
        fit: change a .npz until the robot can perform it: slower, or with its centre of mass moved.
        out: the .npz file for the fitted motion.

    Returns:
        0 if the robot can perform it, 1 if it cannot.
    """
    from poise.baselines.balance.references.motion import load_motion
    from poise.baselines.balance.references.robot_clip import (
        read_robot_clip,
        reference_from,
        write_robot_clip,
    )
    from poise.baselines.motion.feasibility.check import check_motion
    from poise.baselines.motion.feasibility.fit import fit_motion
    from poise.baselines.motion.feasibility.gap import with_gap
    from poise.baselines.registry import momentum_qp_config
    from poise.training.benchmarking.trials.names import check_names
    from poise.training.motion.following.tables import print_feasibility

    check_names(robot=robot, motion=motion)
    if (out is None) == fit:
        raise ConfigError("--fit and --out go together", field="out")
    body, console = load_robot(robot), terminal()
    reference = load_motion(motion, body)
    if reference.commands is not None:
        raise ConfigError(f"is walked by a planner, whose steps are its own: poise motion follow "
                          f"{motion} --controller walk performs it", source=motion,
                          field="motion")  # fmt: skip
    judged = check_motion(reference, body)
    config = momentum_qp_config(controller) if qp else None
    if fit:
        if Path(motion).suffix != ".npz":
            raise ConfigError("only a .npz of poise motion import can be fitted", source=motion,
                              field="fit")  # fmt: skip
        fitted = fit_motion(read_robot_clip(motion), body)
        reference = reference_from(fitted.clip, body, motion)
        judged = fitted.feasibility
        print(f"tempo {fitted.tempo:g}, centre of mass moved by {100 * fitted.moved:.1f} cm")
    if config is not None:
        judged = with_gap(judged, reference, body, config)
    print_feasibility(judged, f"{Path(motion).stem} on {body.name}", console)
    if out is not None:
        write_robot_clip(fitted.clip, out)
        print(out)
    return 0 if judged.feasible else 1


def follow(
    motion: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="MOTION")],
    /,
    *,
    controller: str = "momentum-qp",
    robot: OnRobot = "humanoid",
    starts: int | None = None,
    push: float = 0.0,
    share: float = 0.0,
    directions: int = 8,
    tempo: float = 1.0,
    realism: str | None = None,
    physics: str | None = None,
    waits: Switch = False,
    fastest: Switch = False,
    seed: int = 0,
    out: Path | None = None,
    report: Path | None = None,
    video: Path | None = None,
    size: tuple[int, int] = (640, 480),
    allow: Allow = (),
) -> int:
    """Perform a motion, pushed or not, and report the tracking errors.

    Args:
        motion: a .npz of poise motion import, a packaged motion, a .yaml of one; or a script, whose
            motion is made first: a .motion or .csv file, the name of a packaged one, or its text.
            For a tracker also a clip of its maker's: .npz of Isaac Lab or mjlab, .csv of LAFAN1, or
            "network" for the one within its network.
        controller: a controller as poise evaluate takes it; an external policy that tracks
            motions follows clips.
        starts: number of trials, each from a differently disturbed start; by default 20, or 5 at
            each tempo of --fastest.
        push: impulse of a push at a random time of the motion [N s]; 0 for none.
        share: the same as a share of the J50 of the push's direction, standing (configs/limits).
        directions: number of directions of the pushes, spread evenly.
        tempo: speed factor of the motion.
        realism: realism level: ideal, lab, field, or a .yaml file.
        physics: the engine that steps the robot: mujoco, drake, or a .yaml file of its settings.
        waits: let the motion wait while the robot recovers.
        fastest: find the largest tempo at which none of the trials falls.
        seed: seed of starts and pushes.
        out: a JSON file to write the trials to.
        report: a .html file for pictures of the trial with the largest error: ZMP and centre of
            pressure, errors, tempo, and the timeline of a script's motion.
        video: a .mp4 or .webp file for the first trial, with the motion as a yellow ghost, except
            for a tracker.
        size: width and height of the video [pixels], even.

    Returns:
        0 if no trial fell, 1 if one did.
    """
    from poise.baselines.allowance import allowing
    from poise.training.benchmarking.trials.names import check_names

    script = find_script(motion) if names_script(motion) else None
    is_clip = Path(motion).suffix in (".npz", ".csv") or motion == "network"
    check_names([controller], robot=robot, motion=None if script or is_clip else motion,
                physics=physics)  # fmt: skip
    if share and not push and robot in packaged("robots") and robot not in packaged("limits"):
        raise ConfigError(f"no J50 of {robot!r} was measured: give --push N [N·s] instead",
                          field="share", choices=packaged("limits"))  # fmt: skip
    from poise.baselines.balance.references.tempo import Tempo
    from poise.training.benchmarking.trials.push_limits import load_limits
    from poise.training.motion.following.fastest import STARTS, find_fastest
    from poise.training.motion.following.follow import follow as perform
    from poise.training.motion.following.progress import FollowProgress
    from poise.training.motion.following.tables import print_followed
    from poise.training.motion.following.tracked import follow_clip, following, tracker_config
    from poise.training.pictures.figures.encoder import check_video
    from poise.training.pictures.figures.playback import check_size
    from poise.training.pictures.motion_report.film import MotionFilm
    from poise.training.pictures.motion_report.page import check_page
    from poise.training.pictures.motion_report.performance import Watched, write_performance

    if fastest and (push or share or tempo != 1.0 or waits or out or report or video or physics):
        raise ConfigError("goes with --controller, --robot, --starts and --seed alone",
                          field="fastest")  # fmt: skip
    if out is not None:
        check_out_file(out)
    if report is not None:
        check_page(report)
    if video is not None:
        check_video(video)
        check_out_file(video)
        check_size(size)
    pushed = f"pushed by {push:g} N s" if push else "not pushed"
    pushed = f"pushed by {share:g} of J50" if share else pushed
    faster = f", {tempo:g} times as fast" if tempo != 1.0 else ""
    with allowing([*named(controller), *allow]), ExitStack() as stack:
        tracker = tracker_config(controller)  # before a script is made
        if script is not None:
            from poise.training.motion.following.scripts import open_synthesis, write_motion

            synthesis = open_synthesis(None, robot, script=script, console=terminal(True))
            folder = stack.enter_context(TemporaryDirectory(prefix="poise-"))
            motion = str(Path(folder) / f"{Path(script.source).stem}.npz")
            write_motion(synthesis, script, robot, Path(motion))
        if tracker is not None:
            if fastest or waits or tempo != 1.0 or report:
                raise ConfigError("a tracker follows its clip at the clip's own pace: not with "
                                  "--tempo, --waits, --fastest, --report",
                                  source=controller, field="controller")  # fmt: skip
            if push and share:
                raise ConfigError("give either an impulse or a share of J50", field="share")
        elif fastest:
            find_fastest(motion, controller, robot, STARTS if starts is None else starts, seed)
            return 0
        watched = Watched() if report is not None else None
        film = None if video is None else stack.enter_context(MotionFilm(video, size, watched))
        count = 20 if starts is None else starts
        shown = FollowProgress(count, terminal(stderr=True), film or watched, film is not None)
        watch = stack.enter_context(shown)
        if tracker is not None:
            body = load_robot(robot)
            half = load_limits(body).j50() if share else None

            def impulse(direction: float) -> float:
                return push if half is None else share * half(direction)

            trials = follow_clip(following(tracker, motion), body, starts=count, pushed=impulse,
                                 directions=directions, seed=seed, watch=watch, realism=realism,
                                 physics=physics)  # fmt: skip
        else:
            trials = perform(motion, controller, robot=robot, starts=count, impulse=push,
                             share=share, directions=directions, seed=seed, speed=tempo,
                             tempo=Tempo(waits=True) if waits else None, watch=watch,
                             realism=realism, physics=physics)  # fmt: skip
        title = f"{Path(motion).stem} by {controller} on {robot}{faster}, {pushed}"
        if report is not None and watched is not None:  # while a script's motion is there
            write_performance(report, title, motion, robot, tempo, trials, watched)
    print_followed(trials, title, terminal())
    if out is not None:
        write_atomic(out, json.dumps([asdict(trial) for trial in trials], indent=1) + "\n")
        print(out)
    if video is not None:
        print(video)
    if report is not None:
        print(report)
    return 1 if any(trial.fallen for trial in trials) else 0
