"""What an error is about, in place of how it says it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from poise.configs.errors import ConfigError
from poise.configs.problems import Problem


@contextmanager
def refused(
    problem: str,
    field: str | None = None,
    *,
    source: str | None = None,
    choices: Iterable[str] | None = None,
    **facts: Any,
) -> Iterator[pytest.ExceptionInfo[Problem]]:
    """A block that raises this problem of this field; source, choices and facts where given."""
    with pytest.raises(Problem) as caught:
        yield caught
    found = caught.value
    assert (found.problem, found.field) == (problem, field), found
    assert source is None or found.source == source, found
    assert choices is None or found.choices == tuple(choices), found
    assert {name: found.facts.get(name) for name in facts} == facts, found
    assert "\n" not in str(found)


@contextmanager
def invalid(
    field: str | None, *values: str, source: str | None = None
) -> Iterator[pytest.ExceptionInfo[ConfigError]]:
    """A block that raises a ConfigError of this field, in one line.

    `values` are what its message holds: names, numbers, files; or some of its choices. Its source
    may have folders before `source`.
    """
    with pytest.raises(ConfigError) as caught:
        yield caught
    found = caught.value
    assert found.field == field, found
    for value in values:
        assert value in found.message or value in (found.choices or ()), (value, found)
    assert source is None or str(found.source).endswith(source), found
    assert "\n" not in str(found)
