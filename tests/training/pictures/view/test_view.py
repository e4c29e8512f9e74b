"""`poise view` from outside: what is refused, and how; time; a trial of a result; the window."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from poise.configs.errors import ConfigError, PoiseError
from poise.envs.balance.base import BalanceEnv
from poise.envs.physics.collapse import DURATION
from poise.envs.physics.pushes.push import Push
from poise.envs.viewing import window
from poise.training.benchmarking.results.replay import replay
from poise.training.cli.entry import main
from poise.training.pictures.sessions import live as live_module
from poise.training.pictures.sessions import loading
from poise.training.pictures.sessions.live import Live
from poise.training.pictures.sessions.recorded import _side_by_side, recorded_trial
from poise.training.pictures.sessions.session import load_session
from poise.training.pictures.view import native
from tests.endurance.processes import heed_interrupts
from tests.support.report_folders import SOFT, finished
from tests.support.shared import robot

PUSH = "{impulse: 20, direction: 90, body: torso, start: 0.1}"


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["fedback-step"], "controller: no such controller: 'fedback-step'"),
        (["zero", "--robot", "robby"], "robot: no such name: 'robby'"),
        (["zero", "zero", "zero", "zero"], "controllers: at most 3 side by side, not 4"),
        (["zero", "zero", "--native"], "one controller is shown by --native, not 2"),
        (["zero", "--seconds", "0"], "seconds: must be above 0, not 0.0"),
        (["zero", "--port", "70000"], "port: must be from 0 to 65535, not 70000"),
        (["zero", "--push", "{impulse: 1, body: tail}"], "body: no body 'tail'"),
        (["zero", "--push", "["], "push: is no YAML mapping"),
        (["zero", "--push", "{delta_v: 1.0}"], "push: a kick"),
        (["zero", "--motion", "dance"], "motion: no such name: 'dance'"),
        (["walk", "--command", "["], "command: is no YAML mapping"),
        (["walk", "--command", "{speed: 1}"], "command: speed: unknown field"),
        (["zero", "--controllers", "zero"], "controllers: goes with --trial"),
        (["nowhere", "--trial", "3"], "nowhere: no such folder"),
        (["--trial", "3"], "trial: goes with one folder"),
        ([".", "--trial", "3", "--seconds", "0"], "seconds: must be above 0, not 0.0"),
    ],
)
def test_what_cannot_be_shown_is_one_line(
    args: list[str], message: str, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """With exit code 2, and before a controller is loaded, which would compile."""
    monkeypatch.setattr(loading, "load_session", lambda *_, **__: pytest.fail("loaded"))
    assert main(["view", *args]) == 2
    err = capsys.readouterr().err
    assert err.startswith("poise: ") and message in err and err.count("\n") == 1


@pytest.mark.parametrize("missing", ["viser", "mjviser"])
def test_without_the_extra_it_says_how_to_install_it(
    missing: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, missing, None)
    assert main(["view", "zero"]) == 2
    err = capsys.readouterr().err
    assert "pip install -e '.[view]'" in err and err.count("\n") == 1


def test_a_busy_port_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("viser", reason="not installed: pip install 'poise[view]'")
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert main(["view", "zero", "--port", str(port)]) == 2
    err = capsys.readouterr().err
    assert f"port: {port} on 127.0.0.1 cannot be had" in err and err.count("\n") == 1


def test_it_ends_by_itself_and_says_how_fast_it_was(capsys: pytest.CaptureFixture[str]) -> None:
    """The factor is that of the simulation: 0.5 s are played in half a second."""
    pytest.importorskip("viser", reason="not installed: pip install 'poise[view]'")
    assert main(["view", "zero", "--port", "0", "--seconds", "0.5", "--push", PUSH]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "loading zero" and lines[1].startswith("http://127.0.0.1:")
    assert "ssh -L" in lines[2]
    factor, words = lines[3].split(" × ")
    assert 0.2 < float(factor) <= 1.01 and words.startswith("real time over 0.")


@pytest.mark.parametrize(
    ("number", "code"),
    [(signal.SIGINT, 0), pytest.param(signal.SIGTERM, 143, marks=pytest.mark.weekly)],
)
def test_a_signal_ends_it_at_once(number: int, code: int) -> None:
    """Without a word of a library; Ctrl-C, which is meant to end it, with what was reached."""
    pytest.importorskip("viser", reason="not installed: pip install 'poise[view]'")
    command = [sys.executable, "-m", "poise.training.cli", "view", "zero", "--port", "0"]
    environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment,
        preexec_fn=heed_interrupts,
    )  # fmt: skip
    assert process.stdout is not None
    timer = threading.Timer(120.0, process.kill)
    timer.start()
    while not (line := process.stdout.readline()).startswith("Ctrl-C"):
        assert line
    process.send_signal(number)
    out, err = process.communicate()
    timer.cancel()
    assert process.returncode == code
    assert ("real time" in out) == (code == 0) and "viser" not in out + err
    assert ("poise: stopped" in err) == (code != 0) and "Traceback" not in err


def test_a_trial_of_a_result_is_shown_as_it_was() -> None:
    """Every step of all that took part, the same as in the replay, with a word about the end."""
    folder = finished("random")
    soft = str(next(folder.parent.glob("*.yaml")))
    assert soft.endswith(SOFT)
    play, lines = recorded_trial(folder, 2, [soft, "zero"])
    ends = [line.rsplit(", ", 1)[1] for line in lines if line.endswith("recorded")]
    assert ends == ["exactly as recorded"] * 2
    lengths = []
    for side, name in enumerate((soft, "zero")):
        heights: list[float] = []
        done = replay(folder, 2, name, watch=partial(keep_height, heights))
        assert [frames[side].positions[1, 2] for frames in play.history[: len(heights)]] == heights
        assert play.history[-1][side].fall_time == done.outcome.fall_time
        lengths.append(len(heights))
    assert play.history[-1][1].fall_time is not None
    assert len(play.history) > max(lengths)  # who fell goes to the ground
    fell, lies = play.history[lengths[1] - 1][1], play.history[-1][1]
    assert lies.com[2] < 0.7 * fell.com[2] and lies.fall_time == fell.fall_time
    assert play.spec.command.endswith(f"--trial 2 --controllers '{soft}' zero")


def keep_height(heights: list[float], env: BalanceEnv) -> None:
    heights.append(env.data.xpos[1, 2])


def test_a_recorded_trial_plays_to_its_end_and_is_not_pushed() -> None:
    play, _ = recorded_trial(finished("random"), 0)
    assert play.names == ["zero"] and play.at == 0 and not play.ended
    for _ in range(len(play.history) + 3):
        play.step()
    assert play.ended and play.at == len(play.history) - 1
    play.reset()
    assert play.at == 0
    with pytest.raises(PoiseError, match="a recorded trial cannot be pushed"):
        play.push(impulse=1.0)
    with pytest.raises(ConfigError, match="'pid' took no part"):
        recorded_trial(finished("random"), 0, ["pid"])
    with pytest.raises(ConfigError, match="controllers: at most 3 stand side by side"):
        recorded_trial(finished("random"), 0, ["zero"] * 4)


def test_films_of_other_steps_are_seen_at_one_time() -> None:
    """A policy may step every 40 ms beside one that steps every 20 ms; what is over stays."""
    still = recorded_trial(finished("random"), 0)[0].history[0][0]
    films = [
        [still._replace(time=0.02 * k) for k in range(4)],
        [still._replace(time=0.04 * k) for k in range(3)],
    ]
    times = [[frame.time for frame in both] for both in _side_by_side(films, 0.02)]
    expected = [[0.0, 0.0], [0.02, 0.0], [0.04, 0.04], [0.06, 0.04], [0.06, 0.08]]
    assert np.allclose(times, expected)


@pytest.mark.usefixtures("can_render")
def test_a_session_is_filmed_from_its_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With its pushes, up to now, at the robot's own speed."""
    import imageio_ffmpeg

    live = Live(load_session(["zero"], robot(), 0))
    with pytest.raises(PoiseError, match="nothing has been simulated"):
        live.film("zero", tmp_path / "b.mp4")
    for _ in range(10):
        live.step()
    live.push(impulse=5.0)
    for _ in range(10):
        live.step()
    live.film("zero", tmp_path / "a.mp4")
    _, seconds = imageio_ffmpeg.count_frames_and_secs(str(tmp_path / "a.mp4"))
    fell = live.session.sides[0].fall_time is not None  # then it is shown until it lies
    assert seconds == pytest.approx(0.42 + (DURATION if fell else 0.0), abs=0.03)
    monkeypatch.setattr(live_module, "LONGEST_FILM", 0.3)
    with pytest.raises(PoiseError, match="a video is of at most 0.3 s"):
        live.film("zero", tmp_path / "b.mp4")


class FakeHandle:
    """What the window's loop uses of MuJoCo's viewer, without a window."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, keys: object):
        self.cam, self.user_scn = mujoco.MjvCamera(), mujoco.MjvScene(model, 100)
        self.opt, self.keys, self.running, self.shown = mujoco.MjvOption(), keys, True, 0
        self.perturb = mujoco.MjvPerturb()

    def is_running(self) -> bool:
        return self.running

    def lock(self) -> contextlib.AbstractContextManager[None]:
        return contextlib.nullcontext()

    def sync(self) -> None:
        self.shown += 1

    def close(self) -> None:
        self.running = False


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> native.NativeView:
    """The loop of a window that is not there."""
    import glfw
    import mujoco.viewer

    monkeypatch.setattr(glfw, "init", lambda: True)
    monkeypatch.setattr(window, "atexit", SimpleNamespace(register=id, unregister=id))
    monkeypatch.setattr(
        mujoco.viewer,
        "launch_passive",
        lambda model, data, key_callback, **_: FakeHandle(model, data, key_callback),
    )
    return native.NativeView(Live(load_session(["zero"], robot(), 0)))


def handle_of(opened: native.NativeView) -> FakeHandle:
    assert opened.renderer.viewer is not None
    return opened.renderer.viewer.handle


def pushes_of(opened: native.NativeView) -> list[Push]:
    return list(opened.live.session.pushes)


def test_the_window_is_played_by_keys(opened: native.NativeView) -> None:
    """Pause, one step, pushes in four directions, reset."""
    handle = handle_of(opened)
    opened.run(0.2)
    assert handle.shown > 2 and opened.live.session.time > 0.05
    handle.keys(native.SPACE)
    opened.run(0.05)
    before = opened.live.session.time
    handle.keys(native.RIGHT)
    opened.run(0.05)
    assert opened.live.session.time == pytest.approx(before + 0.02)
    handle.keys(-1)  # GLFW's code of a key that it does not know
    for key in "8456x":
        handle.keys(ord(key))
    opened.run(0.05)
    assert [p.direction for p in opened.live.session.pushes] == [0.0, 90.0, 180.0, -90.0]
    handle.keys(native.BACKSPACE)
    opened.run(0.05)
    assert opened.live.session.pushes == () and opened.live.session.time == 0.0


def test_the_window_s_mouse_pushes_when_it_lets_go(opened: native.NativeView) -> None:
    """A body that is selected and moved, as MuJoCo's window does it, is pushed along the way."""
    perturb, env = handle_of(opened).perturb, opened.live.session.sides[0].env
    body = env.model.body("torso").id
    perturb.select, perturb.localpos[:] = body, [0.05, 0.0, 0.1]
    opened.advance()
    assert pushes_of(opened) == []
    start = env.data.xpos[body] + env.data.xmat[body].reshape(3, 3) @ [0.05, 0.0, 0.1]
    perturb.active, perturb.refselpos[:] = 1, start + [0.0, 0.5, 0.3]
    opened.paused = True
    opened.advance()
    assert pushes_of(opened) == []
    perturb.active = 0
    opened.advance()
    (push,) = pushes_of(opened)
    assert isinstance(push, Push) and push.body == "torso"
    yaw = np.degrees(env.simulation.start_yaw)
    assert push.direction == pytest.approx(90.0 - yaw, abs=0.1)
    assert push.impulse == pytest.approx(robot().mass * 0.5 / robot().height_com, rel=1e-3)


def test_a_push_that_cannot_be_is_no_end_of_the_window(
    opened: native.NativeView, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse(**_: object) -> Push:
        raise ConfigError("no body ''", field="body")

    monkeypatch.setattr(opened.live, "push", refuse)
    handle_of(opened).keys(ord("8"))
    opened.run(0.05)
    assert capsys.readouterr().out == "body: no body ''\n" and opened.live.session.time > 0.0


def test_a_window_that_is_closed_ends_it(opened: native.NativeView) -> None:
    handle_of(opened).running = False
    began = time.monotonic()
    opened.run()
    assert time.monotonic() - began < 1.0
