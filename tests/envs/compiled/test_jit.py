"""envs/compiled/jit.py: what a user sees when kernels compile."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from poise.envs.compiled import jit


def compile_event(module: str | None) -> SimpleNamespace:
    function = SimpleNamespace(__module__=module)
    return SimpleNamespace(data={"dispatcher": SimpleNamespace(py_func=function)})


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    now = [0.0]
    monkeypatch.setattr(jit.time, "perf_counter", lambda: now[0])
    return now


def test_a_long_compilation_is_announced_once(clock, capsys) -> None:
    """One line on the standard error when functions still compile after a second, then no more."""
    patience, kernel = jit.Patience(), compile_event("poise.envs.physics.kinematics")
    patience.on_start(kernel)
    assert capsys.readouterr().err == ""
    for clock[0] in (1.1, 2.0, 3.0):
        patience.on_start(kernel)
        patience.on_end(kernel)
    patience.on_end(kernel)
    output = capsys.readouterr()
    assert output.err == jit.message("envs.physics.kinematics") + "\n" and output.out == ""


def test_short_compilations_and_those_of_others_are_silent(clock, capsys) -> None:
    """Time between compilations does not add up; a user's own functions are not Poise's."""
    patience = jit.Patience()
    for clock[0] in (0.0, 5.0, 10.0):
        patience.on_start(compile_event("poise.envs.physics.kinematics"))
        patience.on_end(compile_event("poise.envs.physics.kinematics"))
    patience.on_start(compile_event("mine"))
    clock[0] = 20.0
    patience.on_start(compile_event("mine"))
    patience.on_start(compile_event(None))  # of no module: what other libraries generate
    assert capsys.readouterr().err == ""


def test_numba_tells_the_listener(clock, capsys, monkeypatch: pytest.MonkeyPatch) -> None:
    """A kernel that is compiled inside another one, a second later, raises the message."""
    (listener,) = [
        item for item in jit.event._registered["numba:compile"] if isinstance(item, jit.Patience)
    ]
    monkeypatch.setattr(listener, "announced", False)
    inner = jit.numba.njit(lambda x: x + 1.0)
    inner.py_func.__module__ = "poise.test"

    @jit.numba.extending.overload(slow := lambda x: None)
    def _slow(x):
        clock[0] += 2.0
        return lambda x: inner(x)

    assert jit.numba.njit(lambda x: slow(x))(1.0) == 2.0
    assert capsys.readouterr().err == jit.message("test") + "\n"
