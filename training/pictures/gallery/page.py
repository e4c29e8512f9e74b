"""`poise gallery`: pushes of a result, simulated again, as a self-contained page."""

import base64
import json
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
from rich.console import Console

from poise.configs.errors import ConfigError
from poise.configs.files import write_atomic
from poise.configs.problems import out_of_range
from poise.envs.physics.pushes.push import Push
from poise.training.benchmarking.diagnosis.words import towards
from poise.training.benchmarking.results.read import Record, Results, load_results
from poise.training.benchmarking.results.replay import replay
from poise.training.pictures.figures.palette import SERIES
from poise.training.pictures.sessions.frames import Frame
from poise.training.pictures.sessions.recorded import Recorder
from poise.training.running.terminal import print_paths

from .shapes import shapes

SECTOR = 45.0  # [deg] in which directions stand together
RATE = 25.0  # [1/s] of frames
BEFORE, LONGEST = 0.3, 4.0  # [s] shown before the push and in all
MOST_BYTES = 10_000_000  # of the page
UNIT = 1000.0  # of a position in a frame: millimetres
TURN = 32767.0  # of an entry of a quaternion


def write_gallery(
    folder: str | Path,
    out: str | Path,
    *,
    controllers: Sequence[str] = (),
    sizes: int = 4,
    console: Console | None = None,
    allow: str | Iterable[str] = (),
) -> Path:
    """Write a page that plays pushes of a finished result; returns its path.

    One opens it from disk: it needs no server and no network. Directions stand together in sectors
    of 45°; of each up to `sizes` pushes are shown, from the smallest to the largest, that all
    controllers met alike. A robot that falls is shown until it lies on the ground.

    Args:
        folder: written by `evaluate` or `benchmark`.
        out: the HTML file.
        controllers: of those that took part, from left to right; none: the best four.
        sizes: of the pushes in each sector.
        console: where progress and the path are printed; None: nowhere.
        allow: external controllers (``module:Class``) that may run.

    Raises:
        ConfigError: as `replay`; no single push that all of them met; more than fits into a page.
        PoiseError: the file cannot be written.
    """
    console = console or Console(quiet=True)
    results = load_results(folder)
    names = list(controllers) or results.summary["ranking"][:4]
    chosen = choose(results, names, sizes)
    if not chosen:
        raise ConfigError("holds no trial of one push that all of these controllers met",
                          source=results.folder, field="controllers")  # fmt: skip
    trials, drawn = [], None
    for k, record in enumerate(chosen, 1):
        console.print(f"playing push {k} of {len(chosen)} again", highlight=False)
        push = results.trial(record).pushes[0]
        films = []
        for name in names:
            recorder = Recorder()
            done = replay(results, record.trial, name, watch=recorder, allow=allow)
            recorder.fall()
            assert recorder.env is not None  # it has been watched
            drawn = drawn or shapes(recorder.env.robot)
            body = recorder.env.robot.model.body(push.body).id
            end = "recovered" if done.outcome.recovered else "not quiet"
            if done.outcome.fall_time is not None:
                end = f"fell after {done.outcome.fall_time:.1f} s"
            films.append({"end": end, "body": body, **packed(recorder.frames, push)})
        trials.append({**_push_fields(push), "trial": record.trial, "films": films})
    page = {"names": names, "colours": _colours(results, names), "shapes": drawn, "rate": RATE,
            "before": BEFORE, "trials": trials}  # fmt: skip
    text = _render(results, page)
    if len(text.encode()) > MOST_BYTES:
        raise ConfigError(f"the page would have {len(text) / 1e6:.0f} MB, more than "
                          f"{MOST_BYTES / 1e6:.0f}: show fewer controllers or sizes",
                          field="sizes")  # fmt: skip
    path = Path(out)
    write_atomic(path, text)
    print_paths([path], console)
    return path


def choose(results: Results, names: Sequence[str], sizes: int) -> list[Record]:
    """The trials that are shown, by sector and by impulse: of one push, met by all of `names`."""
    if sizes < 1:
        raise out_of_range(sizes, field="sizes", least=1)
    met = [{record.met for record in results.of(name)} for name in names]
    for name in names:
        results.record(name, results.records[0].trial)  # refuses who took no part
    sectors: dict[int, list[Record]] = {}
    for record in results.of(names[0]):
        alike = all(record.met in each for each in met) and math.isfinite(record.impulse)
        if alike and len(results.trial(record).pushes) == 1:
            sectors.setdefault(sector(record.direction), []).append(record)
    chosen = []
    for angle in sorted(sectors):
        rising = sorted(sectors[angle], key=lambda record: (record.impulse, record.trial))
        places = np.unique(np.linspace(0, len(rising) - 1, sizes).round().astype(int))
        chosen += [rising[place] for place in places]
    return chosen


def sector(direction: float) -> int:
    """Return the middle of the sector of a direction [deg]."""
    return round(SECTOR * (round(direction / SECTOR) % (360.0 / SECTOR)))


def packed(frames: Sequence[Frame], push: Push) -> dict[str, Any]:
    """Return frames from just before a push on, `RATE` a second, as base64 of little-endian int16.

    Each frame has all bodies but the world: x, y, z in millimetres, then the quaternion w, x, y, z
    times 32767; `bodies` is how many, `frames` how many frames there are.
    """
    times = np.array([frame.time for frame in frames])
    first = max(push.start - BEFORE, 0.0)
    last = min(times[-1], first + LONGEST)
    moments = np.arange(first, last + 1e-9, 1.0 / RATE)
    rows = np.searchsorted(times, moments + 1e-9, "right") - 1
    values = [
        np.hstack([UNIT * frames[row].positions[1:], TURN * frames[row].quaternions[1:]])
        for row in np.maximum(rows, 0)
    ]
    numbers = np.clip(np.round(values), -32768, 32767).astype("<i2")
    data = base64.b64encode(numbers.tobytes()).decode()
    return {"frames": len(numbers), "bodies": numbers.shape[1], "data": data}


def _push_fields(push: Push) -> dict[str, Any]:
    angle = sector(push.direction)
    return {
        "sector": angle,
        "towards": towards(angle),
        "impulse": round(push.impulse, 1),
        "direction": round(push.direction, 1),
        "duration": push.duration,
        "on": push.body,
    }


def _colours(results: Results, names: Sequence[str]) -> list[str]:
    return [SERIES[results.controllers.index(name) % len(SERIES)] for name in names]


def _render(results: Results, page: dict[str, Any]) -> str:
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("poise.training.pictures.gallery", "templates"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    data = json.dumps(page, ensure_ascii=True).replace("<", "\\u003c")  # no end of a script
    settings = results.settings
    return environment.get_template("gallery.html.j2").render(
        data=data, robot=results.summary["robot"]["name"], suite=settings.suite_name,
        seed=settings.seed, realism=results.summary.get("realism", "ideal"),
    )  # fmt: skip
