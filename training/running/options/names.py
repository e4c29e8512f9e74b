"""Packaged names, each with one line: robots, controllers, policies, suites and others."""

import json
import re
from pathlib import Path
from typing import Any, TypedDict

from poise.configs.files import packaged, packaged_folder
from poise.configs.reading import read_yaml

KINDS = {
    "robots": "--robot",
    "controllers": "where a CONTROLLER is named",
    "policies": "where a CONTROLLER is named; poise.load_policy(NAME)",
    "rivals": "policies of other projects, where a CONTROLLER is named",
    "guards": "a recovery policy over a walker, where a CONTROLLER is named",
    "suites": "--suite",
    "realism": "--realism",
    "physics": "--physics",
    "training": "poise train --config",
    "tuning": "poise tune --config",
    "motions": "--motion",
    "constraints": "poise motion import --constraints",
    "envs": "config of an environment",
    "limits": "--limits",
    "human": "poise gait --human",
}
# j50: robot → name → mean J50 [N·s] of the leaderboards in docs/results; suites: robot → suite of
# that J50; policies: name → purpose
FIGURES = "packaged.json"
MOVES = {
    "residual": "targets",
    "step": "targets, steps",
    "walk": "a walk's steps",
    "whole": "servos that take over",
    "torque": "all torques",
    "position": "all joints' servos",
    "velocity": "all joints' servos, as commanded",
}


class Named(TypedDict, total=False):
    """A packaged name.

    `j50` is the mean J50 on the leaderboard of `robot` [N·s]. `on` is the controller below a
    policy, `action` what the policy's action moves.
    """

    name: str
    robot: str
    j50: float
    action: str
    on: str
    about: str


def names_by_kind() -> dict[str, list[Named]]:
    """Return all packaged names by kind, with their facts."""
    known = _known()
    return {kind: [_named(kind, name, known) for name in packaged(kind)] for kind in KINDS}


def suites_of_j50() -> dict[str, str]:
    """Return robot → suite by which J50 was measured."""
    return dict(_known()["suites"])


def _known() -> dict[str, dict[str, Any]]:
    known: dict[str, dict[str, Any]] = json.loads((packaged_folder(".") / FIGURES).read_text())
    return known


def _named(kind: str, name: str, known: dict[str, dict[str, Any]]) -> Named:
    entry: Named = {"name": name}
    scores = known["j50"]
    robots = [robot for robot in scores if name in scores[robot]]
    if kind == "policies":
        config = read_yaml(packaged_folder(kind) / name / "config.yaml")
        robots = [config["robot"]] if config["robot"] in robots else []
        entry |= {"robot": config["robot"], "action": MOVES[config["action"]]}
        entry["about"] = known["policies"].get(name, "")
        if config["action"] not in ("torque", "position", "velocity"):
            entry["on"] = config["controller"]
    else:
        entry["about"] = first_comment(packaged_folder(kind) / f"{name}.yaml")
    if robots and kind in ("controllers", "policies", "rivals"):
        entry["robot"] = robots[0]
        entry["j50"] = scores[robots[0]][name]
    return entry


def first_comment(path: Path) -> str:
    """Return the first sentence of the comment at the top of a file."""
    lines: list[str] = []
    for line in path.read_text().splitlines():
        if not line.startswith("#"):
            break
        lines.append(line.lstrip("# "))
    text = re.sub(
        r" \((docs|see|`poise)[^)]*\)| by `poise tune.*|: `poise [^`]*`", "", " ".join(lines)
    )
    return re.split(r"(?<=[a-z)\]%0-9])\.(?: |$)", text)[0].strip()
