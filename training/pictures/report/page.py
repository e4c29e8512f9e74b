"""A result folder as one HTML file that opens from disk, with nothing outside it."""

import base64
import re
import shlex
from collections.abc import Iterable, Sequence
from pathlib import Path

from rich.console import Console

from poise.baselines.allowance import allow_words, allowing
from poise.configs.errors import PoiseError, raised
from poise.configs.files import write_atomic
from poise.configs.reading import JSON_BYTES, TABLE_BYTES, read_text
from poise.training.benchmarking.evaluation.tables import (
    assisted,
    judged_by_falls,
    stand_in_notes,
)
from poise.training.benchmarking.results.read import Record, Results, load_results
from poise.training.benchmarking.trials.agents import code_of
from poise.training.pictures.figures.style import Inline
from poise.training.pictures.figures.time_series import signal_keys, trial_timeseries
from poise.training.running.files import REPORT, SUMMARY, TRIALS
from poise.training.running.terminal import print_paths

from . import factors, plots, walking, words
from . import tables as report_tables
from .cells import Download, download
from .pages import render_page
from .worst_trials import (
    AFTER,
    Exhibit,
    Film,
    can_draw,
    choose_exhibits,
    film_again,
    frame_times,
    signals_csv,
)

CROWD = 4  # of controllers; with more, bands and bars are shown for the one that is pointed at
EMBEDDED = 600_000  # [bytes] trials.csv is embedded up to this size, beyond it packed
PACKED = 2_500_000  # [bytes] up to this size; a longer one stays in the folder


def write_report(
    folder: str | Path,
    out: str | Path | None = None,
    *,
    films: bool = True,
    console: Console | None = None,
    allow: str | Iterable[str] = (),
) -> Path:
    """Write the report of a finished evaluation or benchmark; returns its path.

    The file holds everything it shows: style, script, plots, pictures, and the numbers as CSV. The
    same folder gives the same file. Trials that cannot be simulated again are left out, and the
    report gives the reason.

    Args:
        folder: written by `evaluate`.
        out: the file; `folder`/report.html if not given.
        films: simulate the worst trials again, for pictures and plots over time (seconds for each).
        console: where progress and the path are printed; None: nowhere.
        allow: external controllers (``module:Class``) that may run; others are not run.

    Raises:
        ConfigError: the folder holds no finished evaluation, or its files are not whole.
        PoiseError: the file cannot be written.
    """
    console = console or Console(quiet=True)
    path = Path(folder) / REPORT if out is None else Path(out)
    results = load_results(folder)
    with allowing(allow):
        write_atomic(path, render(results, films=films, console=console))
    print_paths([path], console)
    return path


def render(results: Results, *, films: bool = True, console: Console | None = None) -> str:
    """Return the page; raises ConfigError where the summary does not hold what it should."""
    console = console or Console(quiet=True)
    baseline = results.reference
    order = results.summary["ranking"]
    tables = {
        "ranking": report_tables.ranking(results, baseline),
        "directions": report_tables.directions(results),
        "pairs": report_tables.paired_rows(results),
        "factors": factors.factor_table(results),
        "sensitivity": factors.sensitivity(results, order),
        "indicators": factors.indicators(results, order),
        "seeds": factors.seed_table(results),
        "errors": factors.error_table(results),
        "walks": walking.walk_table(results, order),
        "walk_costs": walking.cost_table(results, order),
        "phases": walking.phase_table(results, order),
        "levels": walking.level_table(results, order),
        "motions": walking.motion_table(results, order),
        "in_motion": walking.in_motion_table(results, order),
        "smallest": report_tables.smallest(results, order),
        "losses": report_tables.loss_rows(results, order),
    }
    cases, notes = _cases(results, films, console)
    envelope, own_envelopes = plots.envelopes(results)
    falls, curves = plots.falls(results)
    trials = _file(results, TRIALS, TABLE_BYTES)
    return render_page("report.html.j2",
        summary=results.summary,
        trials_met=words.trials_met(results),
        early_falls=words.early_fall_notes(results),
        controllers=[
            {"name": name, "index": results.controllers.index(name),
             "swatch": plots.swatch(results.controllers.index(name))}
            for name in order
        ],
        baseline=baseline,
        assisted=[name for name in order if assisted(results.summary["controllers"][name])],
        lead=words.lead(results),
        tables=tables,
        forests=plots.forests(results),
        envelope=envelope,
        own_envelopes=own_envelopes,
        keys=plots.limit_keys(results) if envelope else {},
        phases=walking.phase_plot(results, order),
        falls=falls,
        curves=curves,
        factors=factors.factor_plots(results, order),
        cases=cases,
        signal_keys=signal_keys(),
        notes=[*stand_in_notes(results.summary), *notes],
        facts=_facts(results),
        trials=trials if trials.size <= PACKED else None,
        summary_file=_file(results, SUMMARY, JSON_BYTES),
        crowded=len(order) > CROWD,
        by_falls=judged_by_falls(results.summary["controllers"]),
    )  # fmt: skip


def _cases(
    results: Results, films: bool, console: Console
) -> tuple[list[dict[str, object]], list[str]]:
    """Return the trials shown, and what to say of those that are not."""
    cases = choose_exhibits(results, results.reference, results.summary["ranking"])
    notes: list[str] = []
    if not films:
        notes.append("The trials were not simulated again: films were switched off.")
    problem = can_draw() if films and cases else None
    if problem:
        notes.append(f"There are no pictures: {problem}.")
    done: dict[tuple[int, str], Film | None] = {}
    shown = []
    for k, case in enumerate(cases, 1):
        found_films: list[Film] = []
        for record in filter(None, (case.record, case.baseline)):
            key = (record.trial, record.controller)
            if films and key not in done:
                console.print(f"playing trial {k} of {len(cases)} again: {record.controller}",
                              markup=False, highlight=False)  # fmt: skip
                times = frame_times(case.record)
                done[key] = _film(results, record, times, not problem, notes, console)
            found = done.get(key)
            if found is not None:
                found_films.append(found)
        shown.append(_shown(case, found_films, results))
    return shown, notes


def _film(
    results: Results,
    record: Record,
    times: Sequence[float],
    draw: bool,
    notes: list[str],
    console: Console,
) -> Film | None:
    try:
        return film_again(results, record, times, draw)
    except PoiseError as error:
        reason = str(error)
    except Exception as error:  # an external controller may raise anything
        reason = raised(error)
    note = f"{record.controller} was not simulated again: {reason}."
    if note not in notes:
        notes.append(note)
        console.print(note, markup=False, highlight=False, soft_wrap=True)
    return None


def _shown(case: Exhibit, films: Sequence[Film], results: Results) -> dict[str, object]:
    """Return a case for the template."""
    record = case.record
    trial = results.trial(record)
    pushes = [(push.start, push.duration) for push in trial.pushes]
    # the last time worth showing
    end = (record.fall_time if record.fallen else (record.start or 0.0) + 3.0) + AFTER
    parts = []
    for each in films:
        who, t = each.record, each.signals.t
        columns = each.signals.columns
        label = (f"Trial {who.trial}, {who.controller}: centre of mass, centre of pressure, "
                 f"capture point, angular momentum and torque over {end:.1f} s.")  # fmt: skip
        name = re.sub(r"[^\w.-]+", "-", f"trial-{who.trial}-{Path(who.controller).name}")
        seen, picture = t <= end + 1e-9, Inline(label, class_="plot time")
        shown = {key: values[seen] for key, values in columns.items()}
        trial_timeseries(picture, t[seen], shown, pushes=pushes)
        parts.append({
            "name": who.controller,
            "swatch": plots.swatch(results.controllers.index(who.controller)),
            "end": _ending(who),
            "same": each.same,
            "frames": [
                (time, "data:image/webp;base64," + base64.b64encode(picture).decode())
                for time, picture in each.frames
            ],
            "plot": picture.svg,
            "download": signals_csv(name, t, columns),
        })  # fmt: skip
    return {
        "case": case,
        "facts": words.push_and_conditions(record, trial),
        "end": _ending(record),
        "why": record.why,
        "films": parts,
        "command": shlex.join([
            *("poise", "replay", str(results.folder), "--trial", str(record.trial)),
            *("--controllers", record.controller, "--video", "trial.mp4"),
            *allow_words(code_of(record.controller)),
        ]),
    }  # fmt: skip


def _ending(record: Record) -> str:
    if record.recovered:
        return "recovered"
    if record.fallen:
        early = ", before the push" if record.fell_first else ""
        return f"fell after {record.fall_time:.2f} s{early}"
    return "upright, not as commanded" if record.line.get("commands") else "stood, but not quiet"


def _facts(results: Results) -> list[tuple[str, str]]:
    """Return the origin of the result."""
    summary, settings = results.summary, results.settings
    machine, versions = summary["machine"], summary["versions"]
    rows = [
        ("Command", summary["command"]),
        ("Commit", summary["commit"]),
        ("Suite", settings.suite_name),
        ("Seed", settings.seed),
        ("Robot", f"{settings.robot} ({settings.robot_fingerprint[:12]})"),
        ("Processor", machine["processor"]),
        ("Cores", machine["cores"]),
        ("Workers", summary["workers"]),
        ("System", machine["system"]),
        ("Duration", f"{summary['seconds']} s"),
        ("Versions", ", ".join(f"{name} {version}" for name, version in versions.items())),
        ("Fingerprints", ", ".join(f"{n} {mark[:12]}" for n, mark in settings.controllers.items())),
    ]
    return [(name, str(value)) for name, value in rows if value is not None]


def _file(results: Results, name: str, most: int) -> Download:
    """Return a file of the folder, packed where it is long."""
    text = read_text(results.folder / name, most)
    return download(name, text, pack=len(text) > EMBEDDED)
