"""training/pictures/view: the page in a real browser, the panel without one, the server."""

from __future__ import annotations

import base64
import io
import re
import socket
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest
from PIL import Image

pytest.importorskip("viser", reason="not installed: pip install 'poise[view]'")
pytest.importorskip("mjviser", reason="not installed: pip install 'poise[view]'")

import viser

from poise.baselines.walking.schedule import TimedCommand
from poise.envs.robots.robot import on_terrain
from poise.envs.terrain.arrays import surface_arrays
from poise.envs.terrain.bumps import Bumps
from poise.envs.terrain.slope import Slope
from poise.envs.terrain.stairs import Stairs
from poise.envs.terrain.terrain import Surface, Terrain
from poise.envs.viewing.quantities import COM, REFERENCE
from poise.training.pictures.sessions.frames import ground_at
from poise.training.pictures.sessions.live import Live, Play
from poise.training.pictures.sessions.loading import load_live
from poise.training.pictures.sessions.session import Session, load_session
from poise.training.pictures.sessions.spec import SessionSpec, Spec
from poise.training.pictures.view import browser
from poise.training.pictures.view.browser import BrowserView
from poise.training.pictures.view.origins import Visits
from poise.training.pictures.view.server import check_port, greeting, serving
from poise.training.pictures.view.stage import (
    FIELD_OF_VIEW,
    LANE,
    ViewStage,
    first_view,
    ground_meshes,
)
from poise.training.pictures.view.walking import Throttle
from tests.support.browser import CHROMIUM, Browser
from tests.support.refused import invalid, refused
from tests.support.shared import robot

NAMES = ["momentum-qp", "zero"]
#: said by viser's own code: a class that is out of date, and a drag that cannot stop a scroll
HARMLESS = (
    "THREE.Clock: This module has been deprecated",
    "Unable to preventDefault inside passive",
)


@pytest.fixture(scope="module")
def server() -> Iterator[viser.ViserServer]:
    with serving("127.0.0.1", 0, visits) as found:
        yield found


visits = Visits()


def load(spec: Spec) -> Play:
    assert isinstance(spec, SessionSpec)
    asked.append(spec)
    return load_live(spec)


asked: list[Spec] = []  # of `load`, by all tests


@pytest.fixture(scope="module")
def session() -> Session:
    return load_session(NAMES[:1], robot())


@pytest.fixture
def view(server: viser.ViserServer, session: Session) -> BrowserView:
    session.reset()
    server.scene.reset()
    server.gui.reset()
    return BrowserView(server, Live(session), load)


def run_until(view: BrowserView, condition: Callable[[], bool], seconds: float = 30.0) -> None:
    """Play until something is so."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it does not come to that"
        view.run(0.05)


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed")
def test_a_browser_shows_it_and_pushes_it(
    view: BrowserView,
    server: viser.ViserServer,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    """The page loads, the robot moves in it, the button and the mouse push it, it saves a picture
    and copies a link; no error."""
    view.toggle()  # until the page is there
    view.panel.wishes.follow(False)  # or the ground would move too
    monkeypatch.setattr(browser, "FRAME", 0.2)  # what a processor can draw without a GPU
    monkeypatch.setattr(browser, "TELL", 0.5)
    server.scene.add_light_directional("/light/sun", intensity=2.0, position=(2.5, 1.0, 5.0))
    page: dict[str, Any] = {}
    url = f"http://127.0.0.1:{server.get_port()}"
    thread = threading.Thread(target=use, args=(url, view, page, tmp_path), daemon=True)
    thread.start()
    run_until(view, lambda: not thread.is_alive(), 500.0)
    assert "failed" not in page, page["failed"]
    wrong = [text for text in page["errors"] if not any(known in text for known in HARMLESS)]
    assert wrong == []
    before, after = page["pictures"]
    moved = float(np.mean(np.any(before != after, axis=2)))
    assert 0.002 < moved < 0.9  # the robot, not all of the scene
    mouse, button = view.play.session.pushes
    assert (button.body, button.direction, button.duration) == ("torso", 0.0, 0.1)
    assert button.impulse == pytest.approx(0.5 * robot().mass, abs=0.1)
    assert 3.0 < mouse.impulse < 30.0 and any(mouse.point)
    saved = np.asarray(Image.open(tmp_path / "poise.png").convert("RGB"))
    assert saved.shape[1] == after.shape[1]  # the scene, whole
    assert 100 < len(np.unique(saved.reshape(-1, 3), axis=0))
    assert tuple(saved[0, 0]) == (255, 255, 255)
    assert page["link"] == url + view.play.spec.link


#: a name that springs in the page if it is taken for Markdown, HTML, MDX or a link
TRAP = (
    "x`<img src=q onerror='window.sprung=1'>`<svg onload='window.sprung=1'>"
    "{(window.sprung=1)}${window.sprung=1}[a](javascript:window.sprung=1)"
)

IN_CODE = TRAP.replace("`", "")  # which is shown as code


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed")
def test_no_name_runs_in_the_page(
    server: viser.ViserServer, session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a controller, robot, motion or error: in labels, plots, lists, Markdown, messages."""
    session.reset()
    server.scene.reset()
    server.gui.reset()
    play = Live(session, SessionSpec((TRAP,), TRAP, TRAP))
    play.names = [IN_CODE]
    view = BrowserView(server, play, load)
    monkeypatch.setattr(browser, "FRAME", 0.2)
    url = f"http://127.0.0.1:{server.get_port()}"
    page: dict[str, Any] = {}

    def look() -> None:
        with Browser(webgl=True, origin=url) as chromium:
            chromium.open(url, width=900, height=460)
            chromium.wait("document.querySelectorAll('.uplot').length == 4", 100.0)
            chromium.wait("document.body.innerText.includes('onerror')")
            view.ask(view._pages.say, TRAP)
            chromium.press("Save", "*")
            chromium.wait("document.body.innerText.split('onerror').length > 4")
            page["sprung"] = chromium.run("window.sprung === undefined ? 'no' : 'yes'")
            page["shown"] = chromium.run("document.body.innerText")
            page["links"] = chromium.run(
                "[...document.querySelectorAll('a')].filter(a => a.href.startsWith('j')).length"
            )

    thread = threading.Thread(target=look, daemon=True)
    thread.start()
    run_until(view, lambda: not thread.is_alive(), 300.0)
    assert page["sprung"] == "no" and page["links"] == 0
    assert f"{IN_CODE}: on its feet" in page["shown"] and TRAP in page["shown"]  # as they are


def use(url: str, view: BrowserView, page: dict[str, Any], folder: Path) -> None:
    """What a user does, from a thread."""
    session = view.play.session
    try:
        with Browser(webgl=True, origin=url) as chromium:
            page["errors"] = chromium.errors
            chromium.open(url, width=900, height=460)
            chromium.wait("document.querySelectorAll('.uplot').length == 4", 100.0)
            chromium.wait("document.body.innerText.includes('momentum-qp: on its feet')")
            before = picture(chromium)
            drag(chromium)  # which lets time go on
            wait(lambda: len(session.pushes) == 1)
            chromium.click("Push")
            wait(lambda: len(session.pushes) == 2 and session.time > session.pushes[1].start + 0.4)
            chromium.click("Pause")
            wait(lambda: view.paused)
            page["pictures"] = before, picture(chromium)
            chromium.save_to(folder)
            chromium.press("Save", "*")
            chromium.press("Picture (PNG)")
            wait((folder / "poise.png").is_file, 180.0)  # drawn once more, in software
            chromium.press("Copy")
            chromium.wait("document.body.innerText.includes('Copied')")
            page["link"] = chromium.run("navigator.clipboard.readText()")
    except BaseException as error:
        page["failed"] = repr(error)
        raise


def wait(condition: Callable[[], bool], seconds: float = 60.0) -> None:
    """Wait until something is so, in another thread than the one that plays."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it does not come to that"
        time.sleep(0.02)


def picture(browser: Browser) -> np.ndarray:
    """The scene without the panels, as the browser shows it."""
    taken = browser.call("Page.captureScreenshot", format="png", clip={**box(browser), "scale": 1})
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(taken["data"]))).convert("RGB"))


def box(browser: Browser) -> dict[str, float]:
    """Where the scene is in the page [pixels]."""
    return browser.run(
        "(({x, y, width, height}) => ({x, y, width, height}))"
        "(document.querySelector('canvas').getBoundingClientRect())"
    )


def drag(browser: Browser) -> None:
    """Drag what is in the middle of the scene to the right."""
    place = box(browser)
    x, y = place["x"] + 0.5 * place["width"], place["y"] + 0.5 * place["height"]
    browser.mouse("Moved", x, y, "none")
    time.sleep(0.2)
    browser.mouse("Pressed", x, y)
    for k in range(1, 7):
        browser.mouse("Moved", x + 10 * k, y)
        time.sleep(0.1)
    browser.mouse("Released", x + 60, y)


def test_controls_ask_and_the_loop_does(view: BrowserView) -> None:
    """Pause, step, seek, reset and push, each done between two steps."""
    run_until(view, lambda: view.play.at > 5)
    view.toggle()
    at = view.play.at
    view.run(0.1)
    assert view.play.at == at and view.panel.pause.label == "Play"
    assert view.panel.pause.icon == viser.Icon.PLAYER_PLAY
    view.ask(view.step)
    view.run(0.1)
    assert view.play.at == at + 1
    view.ask(view.seek, 0.06)
    view.run(0.1)
    assert view.play.at == 3 and view.paused
    assert view.stage.frames[0] is view.play.history[3][0]
    view.ask(view.push, view.panel.fields())
    run_until(view, lambda: len(view.play.session.pushes) == 1)
    assert not view.paused and view.play.session.pushes[0].body == "torso"
    view.ask(view.reset)
    run_until(view, lambda: not view.play.session.pushes)
    assert view.play.session.time < 1.0


def test_a_wrong_push_is_no_end(view: BrowserView) -> None:
    """What the page sends may be anything; the loop goes on."""
    view.ask(view.push, {**view.panel.fields(), "body": "tail"})
    view.ask(view.push, {**view.panel.fields(), "impulse": float("inf")})
    view.run(0.2)
    assert view.play.session.pushes == () and view.play.at > 1


def test_other_controllers_are_loaded(view: BrowserView) -> None:
    """The scene and the plots have a robot and a line for each."""
    view.ask(view.load, "humanoid", NAMES, "standing")
    run_until(view, lambda: len(view.play.names) == 2)
    view.run(0.1)
    handles = [mesh.handle for mesh in view.stage.robots.meshes]
    assert all(len(handle.batched_positions) == 2 for handle in handles)
    bodies = np.array([mesh.body for mesh in view.stage.robots.meshes])
    for side, frame in enumerate(view.stage.frames):
        shown = np.array([handle.batched_positions[side] for handle in handles])
        offset = shown - frame.positions[bodies]
        assert np.allclose(offset, offset[0], atol=1e-5)
        assert (offset[0][1] < -0.3) == (side == 0)
    assert all(len(plot.data) == 3 for plot in view.plots.handles)


def test_only_packaged_names_are_loaded(view: BrowserView) -> None:
    """A page that sends a path, or code, gets nothing."""
    asked: list[object] = []
    view.panel.wishes.load = lambda *names: asked.append(names)
    view.panel.controllers[0].value = "os:system"
    view.panel.load()
    view.panel.controllers[0].value = "capture-step"
    view.panel.robot.value = "../robot.yaml"
    view.panel.load()
    assert asked == []
    view.panel.robot.value = "humanoid"
    view.panel.load()
    view.panel.motion.value = "../squat.npz"
    view.panel.load()
    assert asked == [("humanoid", ["capture-step"], "standing")]


def test_a_controller_that_raises_is_no_end(
    view: BrowserView, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is paused, and can be begun anew."""

    def fail() -> None:
        raise ZeroDivisionError("of a controller")

    with monkeypatch.context() as patch:
        patch.setattr(view.play, "step", fail)
        run_until(view, lambda: view.paused)
    view.toggle()
    run_until(view, lambda: view.play.at > 2)


def test_whatever_a_button_raises_is_no_end(
    view: BrowserView, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A controller that raises in a single step, a page that sends what no page of ours does."""
    told: list[str] = []
    monkeypatch.setattr(view._pages, "say", lambda text, *_: told.append(text))

    def fail() -> None:
        raise ZeroDivisionError("of a controller")

    with monkeypatch.context() as patch:
        patch.setattr(view.play, "step", fail)
        view.ask(view.step)
        view.run(0.1)
    view.ask(view.seek, float("nan"))
    view.run(0.1)
    assert re.fullmatch(r"ZeroDivisionError: of a controller \(test_page.py:\d+\)", told[0])
    assert told[1].startswith("ValueError")
    view.toggle()
    run_until(view, lambda: view.play.at > 2)


def test_marks_can_be_hidden(view: BrowserView) -> None:
    """Each quantity by itself: without the centre of mass there is no sphere."""
    view.run(0.05)
    spheres = view.stage.marks.sets["spheres"]
    assert spheres.handle is not None and spheres.handle.batched_scales.any()
    view.show(COM, False)
    view.run(0.1)
    assert not spheres.handle.batched_scales.any()


def test_a_motion_has_a_ghost(view: BrowserView) -> None:
    """It is loaded, drawn where the reference is, and can be hidden."""
    view.ask(view.load, "humanoid", NAMES[:1], "squat")
    run_until(view, lambda: view.play.spec.motion == "squat" and view.play.at > 3)
    ghosts = view.stage.ghosts
    assert ghosts is not None and len(ghosts.meshes) == len(view.stage.robots.meshes)
    poses = view.stage.frames[0].ghost
    for mesh in ghosts.meshes:
        assert np.allclose(mesh.handle.batched_positions[0], poses.positions[mesh.body], atol=1e-5)
        assert np.allclose(mesh.handle.batched_wxyzs[0], poses.quaternions[mesh.body], atol=1e-5)
        assert mesh.handle.visible
    view.show(REFERENCE, False)
    view.run(0.1)
    assert not any(mesh.handle.visible for mesh in ghosts.meshes)
    assert view.stage.robots.meshes[0].handle.visible


def test_what_only_stands_has_no_ghost(view: BrowserView) -> None:
    view.run(0.1)
    assert view.stage.ghosts is None and view.stage.frames[0].ghost is None


def test_sliders_command_a_walk(view: BrowserView) -> None:
    """They are there where something walks, show what holds, and are heeded now and then."""
    assert not view.panel.walk._folder.visible
    view.open(SessionSpec(("walk",), commands=("{ahead: 0.5, turn: 0.1}",)))
    sliders = view.panel.walk.sliders
    run_until(view, lambda: view.play.at > 2)
    assert view.panel.walk._folder.visible
    shown = [round(s.value, 3) for s in sliders.values()]  # 0.1 rad/s is 5.7°/s
    assert shown == [0.5, 0.0, 6.0, 0.225, 0.055, 0.16, 0.0]  # then what the gait does by itself
    sliders["ahead"].value, sliders["turn"].value = 0.3, -10.0
    for _ in range(50):
        dragged(view, "turn")
        view.run(0.02)
    commands = view.play.session.commands
    assert 2 <= len(commands) < 10
    assert view.play.session.command == TimedCommand(0.3, 0.0, -0.1745, start=commands[-1].start)
    refuse_and_keep(view)
    view.reset()
    assert view.play.session.command.ahead == 0.5
    run_until(view, lambda: sliders["ahead"].value == 0.5)


def dragged(view: BrowserView, name: str) -> None:
    """As when a user moves a slider."""
    view.panel.walk._updated(name, SimpleNamespace(client_id=1))


def refuse_and_keep(view: BrowserView) -> None:
    """Steps are commanded within the robot's reach, refused beyond it, and given back."""
    sliders, session = view.panel.walk.sliders, view.play.session
    width, reach = sliders["width"], session.reach
    assert reach is not None and -1e-9 < width.min - reach.width[0] < 0.005
    assert -1e-9 < reach.width[1] - width.max < 0.005
    width.value, sliders["arm_swing"].value = 0.3, 20.0
    dragged(view, "width")
    dragged(view, "arm_swing")
    run_until(view, lambda: session.command.width == 0.3)
    held = session.command
    assert (held.arm_swing, held.clearance, held.step_length) == (0.3491, None, None)
    sliders["clearance"].value = sliders["clearance"].max  # not in a step as quick as these
    dragged(view, "clearance")
    run_until(view, lambda: sliders["clearance"].value < 0.06)
    assert session.command == held and width.value == 0.3
    shown = view._pages._last[1]
    assert "command.clearance" in shown and "'humanoid' supports" in shown
    view.panel.walk._give_back(SimpleNamespace(client_id=1))
    run_until(view, lambda: session.command.width is None)
    run_until(view, lambda: width.value < 0.23 and sliders["arm_swing"].value == 0.0)
    assert session.command.ahead == 0.3


def test_a_dragged_slider_gives_few_commands() -> None:
    """The newest value each time, the last one too; also when time begins anew."""
    throttle = Throttle(0.25)
    taken: list[float] = []
    for step in range(50):
        throttle.waiting = {"ahead": float(step)}
        if (value := throttle.take(step / 32)) is not None:
            taken.append(value["ahead"])
    assert taken == [0.0, 8.0, 16.0, 24.0, 32.0, 40.0, 48.0]
    assert throttle.take(1.7) is None
    assert throttle.take(1.75) == {"ahead": 49.0} and throttle.take(3.0) is None
    throttle.waiting = {"ahead": 0.0}
    assert throttle.take(0.0) == {"ahead": 0.0}


def test_a_link_is_opened(server: viser.ViserServer, view: BrowserView) -> None:
    """A page whose address names controllers loads them; one that names a file gets a line."""
    visits.opened = view.visited
    asked.clear()
    link = SessionSpec(("zero",), seed=3, pushes=("{impulse: 2, body: torso, start: 1}",)).link
    assert get(server, link).startswith("HTTP/1.1 200 ")
    run_until(view, lambda: view.play.spec.controllers == ("zero",))
    assert view.play.session.trial.pushes[0].impulse == 2.0 and view.play.spec.seed == 3
    answer = get(server, "/?controller=os:system")
    assert answer.startswith("HTTP/1.1 404 ") and "a link may name what is packaged" in answer
    assert get(server, link, "Sec-Fetch-Dest: image").startswith("HTTP/1.1 200 ")
    assert get(server, "/").startswith("HTTP/1.1 200 ")
    view.run(0.1)
    assert len(asked) == 1


def get(server: viser.ViserServer, path: str, *headers: str) -> str:
    """The answer to a browser that opens an address."""
    port = server.get_port()
    lines = [f"GET {path} HTTP/1.1", f"Host: 127.0.0.1:{port}", "Connection: close", *headers]
    with socket.create_connection(("127.0.0.1", port), timeout=10.0) as asked:
        asked.sendall(("\r\n".join(lines) + "\r\n\r\n").encode())
        return asked.makefile("rb").read(400).decode(errors="replace")


def test_a_port_that_is_taken_is_told() -> None:
    """And so is an address that there is not."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with invalid("port", f"{port} on 127.0.0.1"):
            check_port("127.0.0.1", port)
    with refused("range", "port", least=0, most=65535, value="70000"):
        check_port("127.0.0.1", 70000)
    with invalid("host"):
        check_port("no.such.host.invalid", 0)


def test_only_this_machine_sees_it(server: viser.ViserServer) -> None:
    """It listens at the loopback address, says so, and makes no tunnel that a page asks for."""
    assert "this machine alone" in greeting("127.0.0.1", 8080)[1]
    assert "ssh -L 8080:localhost:8080" in greeting("127.0.0.1", 8080)[1]
    assert "everybody" in greeting("0.0.0.0", 8080)[1]
    assert server.get_host() == "127.0.0.1" and server.request_share_url() is None


@pytest.mark.parametrize(
    ("origin", "host", "code"),
    [
        ("http://127.0.0.1:{port}", "127.0.0.1:{port}", 101),
        ("http://localhost:9000", "localhost:9000", 101),  # forwarded by ssh from another port
        (None, "127.0.0.1:{port}", 101),  # no browser
        ("http://elsewhere.example", "127.0.0.1:{port}", 403),
        ("http://127.0.0.1:1", "127.0.0.1:{port}", 403),
        ("http://elsewhere.example", "elsewhere.example", 403),  # a name that was led here
    ],
)
def test_pages_of_others_are_refused(
    server: viser.ViserServer, origin: str | None, host: str, code: int
) -> None:
    """Any page that is open in a browser here could ask; only that of the server is answered."""
    port = server.get_port()
    lines = [
        "GET / HTTP/1.1",
        f"Host: {host.format(port=port)}",
        "Upgrade: websocket",
        "Connection: Upgrade",
        "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==",
        "Sec-WebSocket-Version: 13",
        f"Sec-WebSocket-Protocol: viser-v{viser.__version__}",
    ]
    if origin is not None:
        lines.append(f"Origin: {origin.format(port=port)}")
    with socket.create_connection(("127.0.0.1", port), timeout=10.0) as asked:
        asked.sendall(("\r\n".join(lines) + "\r\n\r\n").encode())
        assert asked.recv(64).startswith(f"HTTP/1.1 {code} ".encode())


@pytest.mark.parametrize(
    ("count", "aspect", "phone"),
    [(1, 0.9, False), (3, 2.0, False), (3, 0.47, True), (1, 0.47, True)],
)
def test_the_first_view_has_all_robots(count: int, aspect: float, phone: bool) -> None:
    """Heads and feet of all, above the controls on a phone."""
    size = 1.0
    eye, target = first_view(size, count, aspect, phone)
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    up, half = np.cross(right, forward), np.tan(np.radians(FIELD_OF_VIEW / 2))
    for side in range(count):
        for height in (0.0, 1.9):
            ray = np.array([0.0, LANE * (side - (count - 1) / 2), height]) - eye
            x, y = ray @ right / (ray @ forward), ray @ up / (ray @ forward)
            assert abs(x) < half * aspect and abs(y) < half
            assert y > -0.25 * half or not phone


@pytest.mark.parametrize(
    "terrain", [Stairs(rise=0.1), Stairs(down=True), Slope(angle=8.0), Bumps(count=9, lowest=0.01)]
)
def test_the_ground_is_what_the_robot_walks_on(terrain: Terrain) -> None:
    """The upper corners of the model's boxes are corners of what is drawn, and nothing is higher;
    beyond half a width nothing is drawn."""
    stands = on_terrain(robot(), terrain)
    model, surfaces, floor = stands.model, surface_arrays(terrain.surfaces()), terrain.floor()
    drawn = np.concatenate([v for v, _ in ground_meshes(surfaces, floor, np.inf).values()])
    corners = np.array([[x, y, 1.0] for x in (-1.0, 1.0) for y in (-1.0, 1.0)])
    boxes = [g for g in range(model.ngeom) if model.geom(g).name.startswith("terrain_")]
    assert len(boxes) == len(drawn) / 8
    for box in boxes:
        turn = np.empty(9)
        mujoco.mju_quat2Mat(turn, model.geom_quat[box])
        tops = (corners * model.geom_size[box]) @ turn.reshape(3, 3).T + model.geom_pos[box]
        for top in tops:
            assert np.min(np.linalg.norm(drawn - top, axis=1)) < 1e-9
    assert drawn[:, 2].max() <= max(terrain.height(x, y) for x, y in drawn[:, :2]) + 1e-9
    for vertices, _ in ground_meshes(surfaces, floor, 0.2).values():
        assert np.abs(vertices[:, 1]).max() <= 0.2


def test_the_page_builds_the_ground_and_goes_down_with_the_robot(
    server: viser.ViserServer, session: Session
) -> None:
    """Once for as long as it is the same; the page's floor is as far below as the robot's."""
    session.reset()
    frame = Live(session).history[0][0]
    stage = ViewStage(server, robot(), ["a", "b"], lambda *_: None)
    stage.show([frame, frame])
    assert not stage.boxes and stage.floor == 0.0
    surfaces = surface_arrays(Stairs(down=True).surfaces())
    last = Stairs(down=True).surfaces()[-1]
    below = frame._replace(surfaces=surfaces, floor=last.height, com=last.middle, time=50.0)
    stage.show([below, below])
    built = list(stage.boxes)
    assert len(built) == 4 and stage.floor == pytest.approx(0.0)  # two shades for each of two
    above = below._replace(com=np.zeros(3), time=100.0)
    stage.show([above, above])
    assert stage.boxes == built and stage.floor == pytest.approx(last.height)
    stage.show([frame, frame])
    assert not stage.boxes
    stage.remove()


def test_a_foothold_lies_on_the_ground() -> None:
    """On the surface below it, and on the floor beside all of them."""
    surfaces = surface_arrays([Surface(0.0, 1.0, -1.0, 1.0, 0.3, 0.2)])
    assert ground_at(np.array([0.75, 0.0]), surfaces, -0.1) == pytest.approx([0.75, 0.0, 0.35])
    assert ground_at(np.array([1.5, 0.0]), surfaces, -0.1) == pytest.approx([1.5, 0.0, -0.1])
