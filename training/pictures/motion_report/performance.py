"""The pages of graphs, of scripts, and of one trial against the motion that it performs."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from poise.baselines.balance.references.motion import load_motion
from poise.baselines.motion.feasibility.check import check_motion
from poise.baselines.motion.graphs.motion_graph import MotionGraph
from poise.configs.reading import is_file, parse_json, parsing, read_text
from poise.envs.robots.robot import load_robot
from poise.training.benchmarking.trials.play import Watch
from poise.training.benchmarking.trials.trial import Trial
from poise.training.motion.following.follow import Followed
from poise.training.pictures.figures.motion_graph import (
    REASONS,
    picture_size,
    plot_graph,
    reason_of,
)
from poise.training.pictures.figures.palette import GREY
from poise.training.pictures.figures.style import Inline, sample

from .over_time import errors_picture, zmp_picture
from .page import Picture, write_page
from .timeline import timeline_picture
from .trace import Tracer

PLAN_BYTES = 4 << 20


class Watched:
    """Remembers every trial; for `follow`."""

    def __init__(self) -> None:
        self.tracers: list[Tracer] = []

    def __call__(self, trial: Trial) -> Watch:
        self.tracers.append(Tracer([(push.start, push.duration) for push in trial.pushes]))
        return self.tracers[-1].watch


def write_performance(
    path: Path, title: str, motion: str, robot: str, speed: float, trials: Sequence[Followed],
    watched: Watched,
) -> None:  # fmt: skip
    """Write the page of the trial that was furthest from the motion, or that fell first.

    Raises PoiseError if the file cannot be written, ConfigError for a record beside the motion
    (.plan.json) that is none.
    """
    errors = [np.inf if trial.fallen else trial.body_error for trial in trials]
    worst = int(np.argmax(errors))
    trace, body = watched.tracers[worst].trace(), load_robot(robot)
    reference = load_motion(motion, body)
    if speed != 1.0:
        reference = reference.at_speed(speed)
    pictures = [errors_picture(trace), zmp_picture(check_motion(reference, body), trace)]
    plan = Path(motion).with_suffix(".plan.json")
    if Path(motion).suffix == ".npz" and is_file(plan) and speed == 1.0:
        with parsing(plan):
            record = parse_json(read_text(plan, PLAN_BYTES))
            pictures.insert(0, timeline_picture(record, trace))
    fallen = sum(trial.fallen for trial in trials)
    lead = (f"Trial {worst + 1} of {len(trials)}, "
            f"{'which fell' if trials[worst].fallen else 'the one furthest from the motion'}: "
            f"{fallen} of {len(trials)} fell.")  # fmt: skip
    write_page(path, title, lead, pictures)


def write_synthesis(path: Path, record: dict[str, Any], motion: Path, robot: str | None) -> None:
    """The page of a script's motion: its timeline and, for a robot, the ZMP.

    Raises PoiseError if the file cannot be written.
    """
    pictures: list[Picture] = [timeline_picture(record)]
    if robot is not None and motion.suffix == ".npz":
        body = load_robot(robot)
        pictures.append(zmp_picture(check_motion(load_motion(motion, body), body)))
    lead = f"{record['script']}".strip()
    write_page(path, f"{motion.stem}, {record['duration']:.1f} s", lead, pictures)


def graph_pictures(graph: MotionGraph) -> list[Picture]:
    """Return the pictures of a graph."""
    count, size, reasons = len(graph.names), picture_size(graph), {}
    matrix = Inline(f"Adjacency matrix of {count} clips, {len(graph.transitions)} transitions.",
                    size, "plot wide" if count > 9 else "plot")  # fmt: skip
    circle = Inline(f"Graph of {count} clips.")
    plot_graph(matrix, graph, ("matrix",))
    plot_graph(circle, graph, ("circle",))
    for text in [why for _, _, why in graph.refused]:
        mark, meaning = REASONS[reason_of(text)]
        reasons[meaning] = sample(GREY, "", mark)
    matrix_caption = ("K of the cheapest transition from each clip (row) to each (column): the "
                      "deeper the colour, the smaller K. Cells without a number have no "
                      "transition; their mark says why, and pointing at it tells it.")  # fmt: skip
    circle_caption = ("An arrow leads to each clip that may follow, the stronger the smaller K "
                      "is. Clips in a broken outline are not in the part in which every clip "
                      "reaches every other.")  # fmt: skip
    return [
        Picture("Which clip may follow which", matrix, matrix_caption, reasons),
        Picture("The graph", circle, circle_caption),
    ]
