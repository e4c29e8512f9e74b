"""Reading of summary.json, which may come from an untrusted source: all of it is validated."""

import math
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from poise.configs.errors import ConfigError, shown
from poise.configs.reading import is_file, read_json
from poise.configs.schema import checked
from poise.configs.spellings import respelled
from poise.configs.texts import check_shown
from poise.training.benchmarking.evaluation.tables import ranked
from poise.training.running.summary import Summary, check_format
from poise.training.running.trial_figures import Rate

#: older name → name of keys, see `respelled`
FORMER = {"played": "evaluated", "steps_as_told_rate": "steps_as_commanded_rate"}
#: keys of an entry that are there together or not at all
ENTRY = (
    ("directions", "j50_mean", "j50_mean_ci95", "j50_mean_per_mass", "j50_min", "j50_bounded",
     "eta_mean", "eta_mean_ci95", "eta_min"),
    ("sectors", "fraction_of", "fraction50"),
)  # fmt: skip
LEVEL = (("stood", "unpushed"), ("j50_mean", "j50_mean_ci95"))  # the same, of a level
#: keys of shares, their intervals, and p-values; and of figures that are not negative
SHARE = re.compile(r"^((recovered|never_fell|fallen|up_again)_(rate|ci95)|p_mcnemar)$")
SIZE = re.compile(r"^(j50|j90|f50|fraction50|share50|eta)(?!_gain)")
MARGIN = 1e-9  # of numbers that were computed and written
LARGEST = 2**53  # of whole numbers except seeds: a float represents each up to here
PAIR = (("both", "only_a", "only_b", "neither", "p_mcnemar"),)  # the same, of a pair


def read_summary(path: str | Path) -> Summary:
    """Return a summary.json; raise ConfigError, naming the file and the field, where it is not
    one."""
    path = Path(path)
    if not is_file(path):
        raise ConfigError("cannot be read (no such file): not a finished result", source=path)
    data = read_json(path)
    check_format(data.get("format"), path)
    data = respelled(data, FORMER, path, free="controllers")
    for field, value in _values(data):
        _check_value(field, value, path)
    summary = checked(Summary, data, path)
    for field, value in _figures(data):
        _check_figure(field, value, path)
    entries = summary["controllers"]
    if not entries or sorted(summary["ranking"]) != sorted(entries):
        raise ConfigError("must name all controllers", source=path, field="ranking")
    if summary["ranking"] != ranked({name: entries[name] for name in summary["ranking"]}):
        raise ConfigError("must name the best controller first", source=path, field="ranking")
    named = [[summary["reference"]], *([pair["a"], pair["b"]] for pair in summary["pairs"]),
             *(curves["controllers"] or [""] for curves in summary["step_limits"])]  # fmt: skip
    for name in (name for names in named for name in names):
        if name not in entries:
            raise ConfigError(f"no such controller: {shown(name)}", source=path, choices=entries)
    for name, entry in entries.items():
        _check_rate(entry, path, f"controllers.{name}")
        _check_together(entry, ENTRY, path, f"controllers.{name}")
        for factor in entry.get("factors", ()):
            for level in factor["levels"]:
                _check_rate(level, path, f"controllers.{name}.factors")
        for each in entry.get("scenarios", ()):
            _check_rate(each, path, f"controllers.{name}.scenarios")
        for at in entry.get("levels", ()):
            _check_rate(at, path, f"controllers.{name}.levels")
            _check_together(at, LEVEL, path, f"controllers.{name}.levels")
    levels = {tuple(at["level"] for at in entry.get("levels", ())) for entry in entries.values()}
    if len(levels) > 1:
        raise ConfigError("must be the same of all controllers", source=path,
                          field="controllers.levels")  # fmt: skip
    for k, pair in enumerate(summary["pairs"]):
        _check_together(pair, PAIR, path, f"pairs[{k}]")
    for k, steps in enumerate(summary["step_limits"]):
        curves = steps["curves"]
        if len({len(curves[key]) for key in ("directions", "1", "2", "inf")}) != 1:
            raise ConfigError("must have as many values as directions", source=path,
                              field=f"step_limits[{k}].curves")  # fmt: skip
    return summary


def _values(data: Any, field: str = "") -> Iterator[tuple[str, object]]:
    """Yield the texts and whole numbers in plain data, keys among them, each with its dotted
    field."""
    if isinstance(data, dict):
        for key, value in data.items():
            yield field, key
            yield from _values(value, f"{field}.{key}" if field else key)
    elif isinstance(data, list):
        for k, value in enumerate(data):
            yield from _values(value, f"{field}[{k}]")
    elif isinstance(data, (str, int)):
        yield field, data


def _check_value(field: str, value: object, path: Path) -> None:
    """Raise ConfigError for an unprintable text or an implausibly large number."""
    if isinstance(value, str):
        check_shown(value, path, field)
    elif abs(value) > LARGEST and not field.endswith(("seed", "]")):  # type: ignore[arg-type]
        raise ConfigError(f"must be at most {LARGEST}, not {shown(value)}", source=path,
                          field=field)  # fmt: skip


def _figures(data: Any, field: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the numbers of mappings and the intervals in plain data, each with its dotted field."""
    for key, value in data.items() if isinstance(data, dict) else enumerate(data):
        name = f"{field}[{key}]" if isinstance(data, list) else f"{field}.{key}".lstrip(".")
        if isinstance(value, dict) or (isinstance(value, list) and not name.endswith("_ci95")):
            yield from _figures(value, name)
        elif isinstance(value, (int, float, list)) and isinstance(data, dict):
            yield name, value


def _check_figure(field: str, value: Any, path: Path) -> None:
    """Raise ConfigError for an interval whose ends are swapped, and for a figure or an end of its
    interval that is out of range."""
    ends = [end for end in value if end is not None] if isinstance(value, list) else [value]
    if ends != sorted(ends):
        raise ConfigError(f"must have its lower end first, not {shown(value)}", source=path,
                          field=field)  # fmt: skip
    key = field.rpartition(".")[2]
    most = 1.0 if SHARE.search(key) else math.inf
    if (most == 1.0 or SIZE.match(key)) and not all(-MARGIN <= e <= most + MARGIN for e in ends):
        words = "from 0 to 1" if most == 1.0 else "0 or more"
        raise ConfigError(f"must be {words}, not {shown(value)}", source=path, field=field)


def _check_together(
    entry: Mapping[str, object], groups: tuple[tuple[str, ...], ...], path: Path, field: str
) -> None:
    for keys in groups:
        lacking = [key for key in keys if key not in entry]
        if 0 < len(lacking) < len(keys):
            raise ConfigError("is missing", source=path, field=f"{field}.{lacking[0]}")


def _check_rate(rate: Rate, path: Path, field: str) -> None:
    if rate["trials"] < 1:
        raise ConfigError("must be at least 1", source=path, field=f"{field}.trials")
    if not 0 <= rate["recovered"] <= rate["trials"]:
        raise ConfigError(f"must be a whole number from 0 to trials, not {rate['recovered']}",
                          source=path, field=f"{field}.recovered")  # fmt: skip
    if abs(rate["recovered_rate"] - rate["recovered"] / rate["trials"]) > MARGIN:
        raise ConfigError(f"must be recovered over trials, not {shown(rate['recovered_rate'])}",
                          source=path, field=f"{field}.recovered_rate")  # fmt: skip
