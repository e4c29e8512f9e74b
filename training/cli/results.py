"""The sub-commands that read finished results: compare, gallery, leaderboard, replay, report."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from poise.configs.errors import ConfigError
from poise.configs.texts import printable
from poise.training.running.options.arguments import Allow, Folder, Json, check_folders, print_json
from poise.training.running.terminal import terminal

if TYPE_CHECKING:
    from poise.envs.physics.pushes.push import Kick, Push
    from poise.training.benchmarking.results.replay import Replay


def compare(
    a: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DIR_A")],
    b: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DIR_B")],
    /,
    *,
    json: Json = False,
) -> None:
    """Print the differences between two results, with intervals.

    Args:
        a: a folder written by poise benchmark or poise evaluate.
        b: another folder of the same kind.
    """
    check_folders(a, b)
    from poise.training.benchmarking.results.compare import compare, print_comparison

    found = compare(a, b)
    print_comparison(found, a, b, terminal(stderr=json))
    if json:
        print_json(asdict(found))


def leaderboard(
    results: Annotated[
        tuple[Path, ...],
        tyro.conf.Positional,
        tyro.conf.arg(metavar="RESULT …", help_behavior_hint=""),
    ],
    /,
    *,
    page: Path | None = None,
) -> None:
    """Write the leaderboard page from benchmarks' results, or that of walks, or of scenarios.

    Args:
        results: a summary.json of poise benchmark, or of poise evaluate with a suite of walks such
            as walkers, the folder that holds it, or a folder of such files. Controllers of later
            results are added, or take the place of earlier ones of their name.
        page: the Markdown file to write; docs/leaderboard.md, docs/walking-leaderboard.md for
            walks, or docs/scenarios.md for scenarios, if not given.
    """
    from poise.training.benchmarking.results.leaderboard import write_leaderboard

    if not results:
        raise ConfigError("needs one or more results", field="results")
    print(write_leaderboard(results, page))


def replay(
    folder: Folder,
    /,
    *,
    trial: int,
    controllers: tuple[str, ...] = (),
    video: Path | None = None,
    plot: Path | None = None,
    allow: Allow = (),
) -> int:
    """Simulate one trial of a result again and check that it ends as recorded.

    Args:
        folder: a folder written by poise evaluate or poise benchmark.
        trial: number of the trial in trials.csv.
        controllers: evaluated controllers to show; the last if not given. A video shows several
            side by side.
        video: an MP4 or WebP file to write.
        plot: a PNG file to write: CoM, CoP, capture point and torque over time.

    Returns:
        1 where it differs from the record, else 0.
    """
    if video is not None:
        from poise.envs.viewing.gl import choose_gl_backend

        choose_gl_backend()
    from poise.configs.outputs import check_out_file

    check_folders(folder)
    from poise.training.benchmarking.results.replay import film, replay

    for file, field in ((video, "video"), (plot, "plot")):
        if file is not None:
            check_out_file(file, field)
    if plot is not None and len(controllers) > 1:
        raise ConfigError("of one controller alone", field="plot")
    replays = [
        replay(folder, trial, name, plot=plot, allow=allow) for name in controllers or (None,)
    ]
    for done in replays:
        _print_replay(done)
    if video is not None:
        film(folder, trial, [done.controller for done in replays], video, allow=allow,
             console=terminal(stderr=True))  # fmt: skip
    for path in (video, plot):
        if path is not None:
            print(path)
    return int(any(done.differences for done in replays))


def _print_replay(done: "Replay") -> None:
    """Print how a trial that was simulated again ended, why, and how it differs from its record."""
    from poise.training.benchmarking.diagnosis.words import push_text, why

    end = "recovered" if done.outcome.recovered else "fell" if done.outcome.fallen else "not quiet"
    if done.outcome.loss == "off command":
        end = "upright, not as commanded"
    print(f"trial {done.trial.number}, {done.controller}: {end}")
    events: list[Push | Kick] = [*done.trial.pushes, *done.trial.kicks]
    events.sort(key=lambda each: each.start)
    print("; ".join(map(push_text, events)) or "no push")
    if reason := why(done.outcome, done.outcome.fall_time):
        print(reason)
    for name, (recorded, now) in done.differences.items():
        print(f"{name}: recorded {printable(recorded) or 'nothing'}, "
              f"now {printable(now) or 'nothing'}")  # fmt: skip
    print("differs from the record" if done.differences else "exactly as recorded")


def report(
    folder: Folder, /, *, out: Path | None = None, films: bool = True, allow: Allow = ()
) -> None:
    """Write one HTML file that shows a result: ranking, envelopes, falls, worst trials, numbers.

    The file is self-contained.

    Args:
        folder: a folder written by poise evaluate or poise benchmark.
        out: file to write; report.html in the folder if not given.
        films: simulate the worst trials again, for pictures and plots over time (seconds for each).
    """
    from poise.envs.viewing.gl import choose_gl_backend

    choose_gl_backend()
    from poise.configs.outputs import check_out_file

    check_folders(folder)
    from poise.training.pictures.report.page import write_report

    if out is not None:
        check_out_file(out)
    write_report(folder, out, films=films, console=terminal(), allow=allow)


def gallery(
    folder: Folder,
    /,
    *,
    out: Path,
    controllers: tuple[str, ...] = (),
    sizes: int = 4,
    allow: Allow = (),
) -> None:
    """Write one HTML file that plays pushes of a result: choose direction, size and controller.

    The file is self-contained: it needs neither server nor network.

    Args:
        folder: a folder written by poise evaluate or poise benchmark.
        out: the HTML file to write.
        controllers: evaluated controllers to show, from left to right; the best four if not given.
        sizes: pushes in each of eight directions, from the smallest to the largest.
    """
    from poise.configs.outputs import check_out_file

    check_folders(folder)
    check_out_file(out)
    from poise.training.pictures.gallery.page import write_gallery

    write_gallery(folder, out, controllers=controllers, sizes=sizes, console=terminal(),
                  allow=allow)  # fmt: skip
