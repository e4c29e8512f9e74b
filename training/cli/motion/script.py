"""`poise motion graph`, `plan` and `synth`: which clip may follow which, and a script performed."""

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import tyro

from poise.baselines.motion.graphs.adjacency import make_graph
from poise.baselines.motion.graphs.motion_graph import StatePlace, Thresholds, Weight, write_graph
from poise.baselines.motion.synthesis.scripts.library import between, find_script
from poise.baselines.motion.synthesis.scripts.printer import sequence_text, to_csv
from poise.configs.errors import ConfigError, shown
from poise.configs.reading import read_yaml
from poise.configs.schema import build
from poise.envs.robots.robot import load_robot
from poise.training.motion.following.scripts import load_clips, open_synthesis, write_motion
from poise.training.pictures.motion_report.page import check_page, write_page
from poise.training.pictures.motion_report.performance import graph_pictures, write_synthesis
from poise.training.running.options.arguments import Switch
from poise.training.running.terminal import terminal

ScriptFile = Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SCRIPT")]
Kind = Literal["insert", "cross", "capture", "inertial", "physical"]
Files = Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="FILE")]


def graph(
    files: Files,
    /,
    *,
    out: Path,
    robot: str | None = None,
    coefficient: float = Thresholds.coefficient,
    angle: float = Thresholds.angle,
    any_feet: Switch = False,
    least: float = Thresholds.least,
    most: float = Thresholds.most,
    time_price: float = Thresholds.time_price,
    each: int = Thresholds.each,
    weights: Path | None = None,
    state: tuple[str, ...] = (),
    plot: Path | None = None,
    report: Path | None = None,
) -> None:
    """Find out which clips may follow which, and where: a motion graph as YAML.

    Args:
        files: .bvh files or names of packaged clips, all of one skeleton; with a robot a .npz, or
            a motion with steps by its name or .yaml, too.
        out: the .yaml file to write.
        robot: robot that the clips are retargeted to; by default they keep their skeleton.
        coefficient: largest K of a transition.
        angle: largest turn of a joint in it [degrees].
        any_feet: allow transitions between different planted feet.
        least: shortest transition [s].
        most: longest transition [s].
        time_price: price of a second of transition, or of what no script asks for, in units of K.
        each: most transitions of a pair of clips.
        weights: a .yaml file of an expert: weights, a list of before, after and weight.
        state: postures by name, as NAME=CLIP@SECONDS.
        plot: a .png file for the adjacency matrix and the graph.
        report: a .html file for both, which follows light and dark.
    """
    from poise.training.motion.following.script_tables import print_graph

    if report is not None:
        check_page(report)
    limits = build(Thresholds, {
        "coefficient": coefficient, "angle": angle, "contacts": not any_feet, "least": least,
        "most": most, "time_price": time_price, "each": each}, "graph")  # fmt: skip
    body = None if robot is None else load_robot(robot)
    loaded = load_clips([str(file) for file in files], body, console=terminal(stderr=True))
    made = make_graph(loaded, limits, _weights(weights), _states(state), robot or "")
    write_graph(made, out)
    print_graph(made, terminal())
    print(out)
    if plot is not None:
        from poise.training.pictures.figures.motion_graph import plot_graph

        plot_graph(plot, made)
        print(plot)
    if report is not None:
        lead = f"{len(made.clips)} clips, {len(made.transitions)} transitions."
        write_page(report, f"{out.stem}, a motion graph", lead, graph_pictures(made))
        print(report)


def plan(
    script: ScriptFile,
    /,
    *,
    graph: Path | None = None,
    robot: str | None = None,
    k: int = 1,
    table: Switch = False,
    kind: Kind | None = None,
) -> None:
    """The cheapest ways of a script through a motion graph, without making the motion.

    Args:
        script: a .motion file, a .csv of --table, the name of a packaged script, or its text.
        graph: a file of poise motion graph; by default the packaged clips.
        robot: robot that the packaged clips are retargeted to; by default they keep their skeleton.
        k: number of alternatives.
        table: also print the script as a comma-separated table.
        kind: kind of transitions that the script leaves open; by default physical with a robot,
            which lasts as long and bends as much as it needs, and insert without.
    """
    from poise.training.motion.following.script_tables import print_plan

    tree = find_script(script)
    synthesis = open_synthesis(graph, robot, kind, script=tree, console=terminal(stderr=True))
    print_plan(synthesis.plan(tree, k), sequence_text(tree.sequence), terminal())
    if table:
        print(to_csv(tree), end="")


def synth(
    script: ScriptFile,
    /,
    *,
    out: Path,
    robot: str | None = None,
    graph: Path | None = None,
    start: Annotated[str | None, tyro.conf.arg(name="from")] = None,
    goal: Annotated[str | None, tyro.conf.arg(name="to")] = None,
    kind: Kind | None = None,
    least: float | None = None,
    report: Path | None = None,
) -> None:
    """Make the motion of a script, and a file beside it with every choice (.plan.json).

    Args:
        script: a .motion file, a .csv of --table, the name of a packaged script, or its text.
        out: the file to write: .npz for a robot to follow, or .bvh.
        robot: robot that the motion is for; by default the skeleton of the clips, as .bvh.
        graph: a file of poise motion graph; by default the packaged clips.
        start: a posture from which the motion begins, as <NAME> in a script.
        goal: a posture in which it ends.
        kind: kind of transitions that the script leaves open; by default physical with a robot,
            which lasts as long and bends as much as it needs, and insert without.
        least: shortest transition of the packaged clips [s]; a graph has its own.
        report: a .html file for the script's timeline and, for a robot, the ZMP of the motion.
    """
    if out.suffix not in ((".npz", ".bvh") if robot else (".bvh",)):
        raise ConfigError("must be the name of a .npz or .bvh file; a .npz needs --robot",
                          source=out, field="out")  # fmt: skip
    if report is not None:
        check_page(report)
    begin = time.monotonic()
    tree = between(find_script(script), start, goal)
    synthesis = open_synthesis(graph, robot, kind, least, tree, terminal(stderr=True))
    record = write_motion(synthesis, tree, robot, out)
    print(f"{record['duration']:.1f} s, made in {time.monotonic() - begin:.1f} s")
    print(out)
    if report is not None:
        write_synthesis(report, record, out, robot)
        print(report)


def _weights(path: Path | None) -> tuple[Weight, ...]:
    if path is None:
        return ()
    data = read_yaml(path)
    rows = data.get("weights")
    if set(data) != {"weights"} or not isinstance(rows, list):
        raise ConfigError("must hold a list, weights, and nothing else", source=path)
    return tuple(build(Weight, row, f"{path}: weights[{i}]") for i, row in enumerate(rows))


def _states(texts: Sequence[str]) -> dict[str, StatePlace]:
    states = {}
    for text in texts:
        name, _, place = text.partition("=")
        clip, _, seconds = place.rpartition("@")
        try:
            data = {"clip": clip, "time": float(seconds)}
        except ValueError:
            data = {}
        if not name.isidentifier() or not data:
            raise ConfigError(f"must be NAME=CLIP@SECONDS, not {shown(text)}", field="state")
        states[name] = build(StatePlace, data, f"state {name}")
    return states
