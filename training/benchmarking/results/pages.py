"""Helpers of the pages generated from committed files summary.json."""

from collections.abc import Callable, Mapping, Sequence

from poise.configs.errors import ConfigError
from poise.configs.texts import code, markdown_page, markdown_table
from poise.envs.physics.engines.config import MUJOCO
from poise.training.running.summary import Summary

Table = tuple[Sequence[str], list[list[str]]]  # headings and rows, as `markdown_table` takes them


def page_of(template: str, **values: object) -> str:
    """Return the Markdown of a template of this package, with `table`, `code` and `commit`."""
    known = {"table": markdown_table, "code": code, "commit": _commit}
    return markdown_page("poise.training.benchmarking.results", template, **known, **values)


def check_alike(
    summaries: Mapping[str, Summary], shared: Callable[[Summary], Mapping[str, object]]
) -> None:
    """Raise ConfigError for a result that does not share with the first what it is to, and the
    engine that stepped the robot."""

    def of(summary: Summary) -> dict[str, object]:
        return {**shared(summary), "physics": summary.get("physics", MUJOCO)}

    first, *_ = summaries
    wanted = of(summaries[first])
    for source, summary in summaries.items():
        for field, value in of(summary).items():
            if value != wanted[field]:
                raise ConfigError(f"is not that of {first}", source=source, field=field)


def _commit(summary: Summary) -> str:
    """Return the commit of a result."""
    return code((summary["commit"] or "unknown")[:10])
