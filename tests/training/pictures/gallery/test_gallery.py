"""training/pictures/gallery: the page that plays pushes of a result, and what it is made of."""

from __future__ import annotations

import base64
import json
import re
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from poise.configs.errors import ConfigError
from poise.training.benchmarking.results.read import load_results
from poise.training.benchmarking.results.replay import replay
from poise.training.cli.entry import main
from poise.training.pictures.gallery.page import TURN, UNIT, choose, sector, write_gallery
from poise.training.pictures.gallery.shapes import shapes
from poise.training.pictures.sessions.recorded import Recorder
from tests.support.browser import CHROMIUM, Browser
from tests.support.refused import refused
from tests.support.report_folders import finished
from tests.support.shared import robot


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of a small result of two controllers."""
    return write_gallery(finished("random"), tmp_path_factory.mktemp("gallery") / "page.html")


def content(page: Path) -> dict[str, Any]:
    """What the page's script reads."""
    text = page.read_text(encoding="utf-8")
    found = re.search(r'id="data">(.*?)</script>', text, re.DOTALL)
    assert found is not None
    return json.loads(found[1])


@pytest.mark.parametrize("name", ["humanoid", "compact"])
def test_shapes_are_where_the_geoms_are(name: str) -> None:
    """A capsule's ends and radius, a box's corners, in any posture, as MuJoCo places the geoms."""
    body, model = robot(name), robot(name).model
    data, found = mujoco.MjData(model), shapes(body)
    data.qpos[:] = body.standing_qpos
    data.qpos[7:] += np.random.default_rng(0).normal(0.0, 0.3, model.nq - 7)
    mujoco.mj_forward(model, data)
    own = [g for g in range(model.ngeom) if model.geom_bodyid[g] > 0 and model.geom_group[g] < 3]
    assert len(found) == len(own)
    for geom, shape in zip(own, found, strict=True):
        frame, place = data.xmat[shape["body"]].reshape(3, 3), data.xpos[shape["body"]]
        points = np.array(shape.get("ends", shape.get("corners"))) @ frame.T + place
        np.testing.assert_allclose(points.mean(axis=0), data.geom_xpos[geom], atol=2e-3)
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CAPSULE:
            axis = data.geom_xmat[geom].reshape(3, 3)[:, 2] * model.geom_size[geom, 1]
            np.testing.assert_allclose(points[1] - points[0], 2.0 * axis, atol=3e-3)
            assert shape["r"] == pytest.approx(model.geom_size[geom, 0], abs=1e-3)


def test_the_page_holds_what_was_played(page: Path) -> None:
    """Poses to the millimetre, the end of each trial; it asks nobody for anything."""
    found, results = content(page), load_results(finished("random"))
    assert "http" not in page.read_text() and page.stat().st_size < 10_000_000
    assert found["names"] == results.summary["ranking"]
    shown, k = found["trials"][0], 0
    recorder = Recorder()
    done = replay(results, shown["trial"], found["names"][k], watch=recorder)
    film = shown["films"][k]
    assert ("fell" in film["end"]) == done.outcome.fallen
    values = np.frombuffer(base64.b64decode(film["data"]), "<i2").reshape(film["frames"], -1, 7)
    push = done.trial.pushes[0]
    moment = max(push.start - found["before"], 0.0) + 1.0 / found["rate"]
    frame = [each for each in recorder.frames if each.time <= moment + 1e-9][-1]
    np.testing.assert_allclose(values[1, :, :3] / UNIT, frame.positions[1:], atol=0.6e-3)
    np.testing.assert_allclose(values[1, :, 3:] / TURN, frame.quaternions[1:], atol=1e-4)


def test_pushes_are_chosen_by_direction_and_size() -> None:
    """Of each sector from the smallest to the largest, that all have met."""
    results = load_results(finished("random"))
    names = results.summary["ranking"]
    every, one = choose(results, names, 100), choose(results, names, 1)
    assert {sector(r.direction) for r in every} == {sector(r.direction) for r in one}
    assert len(one) == len({sector(r.direction) for r in one}) <= len(every)
    assert [sector(a) for a in (0.0, 22.0, 23.0, 350.0, 180.0)] == [0, 0, 45, 0, 180]
    with refused("range", "sizes", least=1):
        choose(results, names, 0)
    with pytest.raises(ConfigError, match="'pid' took no part"):
        choose(results, ["pid"], 1)


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Bad input is one line."""
    out = str(tmp_path / "page.html")
    assert main(["gallery", "nowhere", "--out", out]) == 2
    assert capsys.readouterr().err == "poise: nowhere: no such folder\n"
    args = ["gallery", str(finished("random")), "--out", out, "--controllers", "zero"]
    assert main([*args, "--sizes", "1"]) == 0 and out in capsys.readouterr().out
    assert content(Path(out))["names"] == ["zero"]


@pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium")
def test_the_page_plays_in_a_browser(page: Path) -> None:
    """On a phone and a desk: nothing is wider than the window, a robot is drawn, buttons choose."""
    with Browser() as browser:
        for width in (400, 1400):
            browser.open(page, width, 1000)
            assert browser.run("document.documentElement.scrollWidth") <= width
            browser.wait("time > 0.1")
            inked = (
                "(c => {const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;"
                "let n = 0; for (let i = 0; i < d.length; i += 4) n += d[i + 2] > d[i] + 60;"
                "return n})(document.querySelector('canvas'))"
            )
            assert browser.run(inked) > 300
        browser.run("choose(page.trials.length - 1)")
        assert browser.run("trial") == len(content(page)["trials"]) - 1
        first = content(page)["names"][0]
        browser.press(first)
        assert browser.run("shown.size") == len(content(page)["names"]) - 1
        assert not browser.errors
