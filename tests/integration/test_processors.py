"""tests/processors.py: the suite under other processors' settings."""

import subprocess

import pytest

from tests import processors
from tests.processors import SETTINGS, Setting

OUTPUT = """..F
=========================== short test summary info ============================
FAILED tests/test_a.py::test_b[1] - AssertionError: no
1 failed, 2 passed in 3.21s
"""


@pytest.fixture
def started(monkeypatch):
    """Instead of running pytest: environments it would get; `fails` names caches where it fails."""
    calls, fails = [], set()

    def run(command, env, stdout, **_):
        calls.append(env)
        bad = any(name in env["NUMBA_CACHE_DIR"] for name in fails)
        stdout.write(OUTPUT if bad else "...\n3 passed in 1.00s\n")
        return subprocess.CompletedProcess(command, int(bad))

    monkeypatch.setattr(processors.subprocess, "run", run)
    return calls, fails


def test_a_line_for_each_run_and_the_tests_that_failed(started, tmp_path, capsys) -> None:
    """Settings by turns; the exit code is 1 if any run failed, and outputs are kept."""
    calls, fails = started
    options = [
        "--repeat",
        "2",
        "--folder",
        str(tmp_path),
        "--only",
        "host",
        "--only",
        "host-strict",
    ]
    assert processors.main(options) == 0
    fails.add("strict")
    assert processors.main(options) == 1
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(",")[0].split() for line in lines[:2]] == [
        ["host", "run", "1:", "3", "passed"], ["host-strict", "run", "1:", "3", "passed"],
    ]  # fmt: skip
    assert lines[-2].startswith("host-strict      run 2: 1 failed, 2 passed, ")
    assert lines[-1] == "    FAILED tests/test_a.py::test_b[1]"
    assert (tmp_path / "host-strict-2.log").read_text() == OUTPUT
    assert [env["POISE_FASTMATH"] for env in calls] == ["1", "0"] * 4


def test_what_cannot_run_here_is_left_out(started, tmp_path, monkeypatch, capsys) -> None:
    """Another machine's setting, and one whose features are missing."""
    monkeypatch.setattr(processors.platform, "machine", lambda: "mips")
    settings = (Setting("there", machine="x86_64"), Setting("more", needs=("sse97",)))
    monkeypatch.setattr(processors, "SETTINGS", settings)
    assert processors.main(["--folder", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "there            left out: for x86_64, this is mips" in said
    assert "more             left out: this processor has no sse97" in said
    assert not started[0]


def test_settings_do_not_share_kernels(tmp_path) -> None:
    """Each has its name, its cache, and its threads."""
    assert len({setting.name for setting in SETTINGS}) == len(SETTINGS)
    for setting in SETTINGS:
        chosen = setting.environment(tmp_path / setting.name)
        assert chosen["NUMBA_CACHE_DIR"] == str(tmp_path / setting.name)
        assert {chosen[name] for name in processors.THREADS} == {str(setting.threads)}
