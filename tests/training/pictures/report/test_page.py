"""training/pictures/report/page.py, training/report_*.py and the templates."""

from __future__ import annotations

import base64
import csv
import functools
import io
import json
import re
from collections.abc import Callable, Iterator
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path

import pytest

from poise.configs.errors import ConfigError, WriteError
from poise.training.benchmarking.results.read import load_results
from poise.training.cli.entry import main
from poise.training.pictures.report import page as html_report
from poise.training.pictures.report.page import write_report
from poise.training.running.files import csv_text
from tests.support.browser import CHROMIUM, Browser
from tests.support.report_folders import SOFT, copied, finished
from tests.support.weekly import daily


class Page(HTMLParser):
    """What a page links to, shows and says."""

    def __init__(self, text: str):
        super().__init__()
        self.tags: list[tuple[str, dict[str, str]]] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, {name: value or "" for name, value in attributes}))

    def all(self, *names: str) -> list[dict[str, str]]:
        return [attributes for tag, attributes in self.tags if tag in names]

    @property
    def files(self) -> dict[str, str]:
        """Name → text of what can be saved."""
        links = [a for a in self.all("a") if "download" in a]
        texts = {a["download"]: a["href"].split(";base64,")[1] for a in links}
        return {name: base64.b64decode(text).decode() for name, text in texts.items()}


@pytest.fixture(autouse=True)
def _few(few_frames: None) -> None:
    """Strips are short."""


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """The report of a small evaluation, without pictures where nothing can be drawn."""
    folder = tmp_path_factory.mktemp("report")
    return functools.cache(lambda name: write_report(finished(name), folder / f"{name}.html"))


@pytest.fixture(params=daily(["benchmark", "random", "envelope"]))
def report(request: pytest.FixtureRequest, written: Callable[[str], Path]) -> Path:
    """Each of three."""
    return written(request.param)


def test_the_page_stands_alone(report: Path) -> None:
    """Nothing is asked of a network; inner links, labels and headings lead somewhere."""
    text = report.read_text()
    page = Page(text)
    for attributes in page.all("a", "img", "link", "script", "iframe", "source", "use"):
        target = attributes.get("href") or attributes.get("src") or ""
        assert target.startswith(("data:", "#", "")) and "//" not in target[:12]
    assert not re.search(r"url\(|@import", text) and "default-src 'none'" in text
    ids = [attributes["id"] for _, attributes in page.tags if "id" in attributes]
    assert len(ids) == len(set(ids))
    inner = [a["href"][1:] for a in page.all("a") if a.get("href", "").startswith("#")]
    labels = [a["aria-labelledby"] for _, a in page.tags if "aria-labelledby" in a]
    assert set(inner + labels) <= set(ids) and {"ranking", "trials", "origin"} <= set(inner)
    levels = [int(tag[1]) for tag, _ in page.tags if re.fullmatch(r"h\d", tag)]
    assert levels[0] == 1 and all(b - a <= 1 for a, b in pairwise(levels))
    assert all(attributes.get("alt") for attributes in page.all("img"))
    assert all(a.get("aria-label") or a.get("aria-hidden") == "true" for a in page.all("svg"))
    assert all("scope" in attributes for attributes in page.all("th"))
    assert report.stat().st_size < 1_500_000


def test_the_headline_counts_common_trials(report: Path) -> None:
    """Those of an envelope's second stage are each controller's own; p of one pair needs no
    correction."""
    text = report.read_text()
    results = load_results(finished(report.stem))
    one, two = ({record.met for record in results.of(name)} for name in results.controllers)
    same = f"on the same {len(one)} trials."
    told = same if one == two else f"with {len(one)} trials each, {len(one & two)} of them common"
    assert f"2 controllers {told}" in text and (one == two) is (report.stem == "random")
    assert "not corrected" not in text and "fell before the push" not in text


def test_falls_before_the_push_are_no_silent_losses(tmp_path: Path) -> None:
    """A line says how many, and the trial says so too."""
    folder = copied("random", tmp_path)
    lines = list(csv.DictReader(io.StringIO((folder / "trials.csv").read_text())))
    fallen = [line for line in lines if line["fall_time"]]
    for line in fallen:
        line["start"] = str(float(line["fall_time"]) + 0.1)
    (folder / "trials.csv").write_text(csv_text(lines, list(lines[0])))
    text = write_report(folder, films=False).read_text()
    count = sum(line["controller"] == "zero" for line in fallen)
    assert f"zero fell before the push in {count} of 8 trials, which count as lost." in text
    assert " s, before the push</span>" in text


def test_names_are_escaped(report: Path) -> None:
    """A controller's name with quotes, < and & is text, wherever it is written."""
    text = report.read_text()
    name = next(n for n in load_results(finished(report.stem)).controllers if n.endswith(SOFT))
    assert "<b>" not in text and name.replace("&", "&amp;").split("<")[0].split('"')[0] in text


def test_every_number_can_be_saved(report: Path) -> None:
    """The files of the page hold what the folder holds, digit by digit."""
    folder = finished(report.stem)
    files = Page(report.read_text()).files
    assert files["trials.csv"] == (folder / "trials.csv").read_text()
    summary = json.loads((folder / "summary.json").read_text())
    assert json.loads(files["summary.json"]) == summary
    summary = load_results(folder).summary
    for row in csv.DictReader(io.StringIO(files["ranking.csv"])):
        entry = summary["controllers"][row["controller"]]
        assert float(row["recovered_rate"]) == entry["recovered_rate"]
        assert [float(row[f"recovered_rate_{end}"]) for end in ("low", "high")] == pytest.approx(
            entry["recovered_ci95"]
        )
        if report.stem != "random":
            assert float(row["j50_mean"]) == entry["j50_mean"]
            assert float(row["eta_worst"]) == entry["eta_min"]
    directions = list(csv.DictReader(io.StringIO(files["directions.csv"])))
    expected = [len(e.get("directions") or e["sectors"]) for e in summary["controllers"].values()]
    assert len(directions) == sum(expected)
    assert any(name.startswith("trial-") for name in files)


def test_the_same_folder_gives_the_same_file(
    written: Callable[[str], Path], tmp_path: Path
) -> None:
    """No date, no random name."""
    again = write_report(finished("benchmark"), tmp_path / "again.html")
    assert again.read_bytes() == written("benchmark").read_bytes()


def test_without_a_renderer_it_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The plots over time stay, the frames go."""
    monkeypatch.setattr(html_report, "can_draw", lambda: "MuJoCo cannot draw off-screen")
    text = write_report(finished("random"), tmp_path / "r.html").read_text()
    assert "There are no pictures: MuJoCo cannot draw off-screen." in text
    assert "<img" not in text and 'class="plot time"' in text


def test_trials_that_cannot_be_played_again_are_left_out(tmp_path: Path) -> None:
    """A robot that has changed since: the rest of the report stays, with the reason."""
    folder = copied("random", tmp_path)
    path = folder / "settings.yaml"
    fingerprint = load_results(folder).settings.robot_fingerprint
    path.write_text(path.read_text().replace(fingerprint, "f" * 64))
    text = write_report(folder).read_text()
    assert "was not simulated again" in text and "has changed since" in text
    assert 'class="plot time"' not in text and 'id="ranking-table"' in text
    shorter = write_report(finished("random"), tmp_path / "plain.html", films=False).read_text()
    assert "films were switched off" in shorter and 'class="plot time"' not in shorter


def test_a_report_is_written_whole_or_not_at_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The command: a file or one line of error; what was there stays."""
    folder = copied("random", tmp_path)
    assert main(["report", str(folder), "--no-films"]) == 0
    assert capsys.readouterr().out.strip() == str(folder / "report.html")
    before = (folder / "report.html").read_bytes()
    (folder / "trials.csv").write_text("trial,controller\n")
    assert main(["report", str(folder)]) == 2
    error = capsys.readouterr().err
    assert error.startswith("poise: ") and error.count("\n") == 1 and "lacks the columns" in error
    assert (folder / "report.html").read_bytes() == before
    with pytest.raises(ConfigError, match="no such folder"):
        write_report(tmp_path / "nothing")
    (tmp_path / "file").write_text("")
    with pytest.raises(WriteError):
        write_report(finished("random"), tmp_path / "file" / "r.html", films=False)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("j50_mean", "much"),
        ("j50_mean_ci95", [1]),
        ("directions", "all"),
        ("directions", [{"direction": "north", "j50": 1}]),
        ("root_force_max", True),
    ],
)
def test_a_summary_of_another_form_is_refused(key: str, value: object, tmp_path: Path) -> None:
    """One line that names the field, before anything is played or written."""
    folder = copied("envelope", tmp_path)
    data = json.loads((folder / "summary.json").read_text())
    next(iter(data["controllers"].values()))[key] = value
    (folder / "summary.json").write_text(json.dumps(data))
    with pytest.raises(ConfigError, match=r"summary\.json"):
        write_report(folder)
    assert not (folder / "report.html").exists()


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    if CHROMIUM is None:
        pytest.skip("needs chromium")
    with Browser() as opened:
        yield opened


BROKEN = "[...document.images].filter((i) => !i.complete || !i.naturalWidth).length"
WIDER = """((width) => [...document.querySelectorAll("body *")].filter((e) => {
  if (e.closest(".scroll, .hidden, .skip, svg")) return false;
  return e.getBoundingClientRect().right > width + 1;
}).map((e) => e.outerHTML.slice(0, 80)))"""


@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("width", [320, 390, 1280])
def test_a_browser_shows_it(report: Path, browser: Browser, width: int, dark: bool) -> None:
    """No error, no broken picture, nothing beyond the edge; text stands out from its ground."""
    browser.errors.clear()
    browser.open(report, width, dark=dark)
    browser.run('document.querySelectorAll("details").forEach((d) => { d.open = true; })')
    assert browser.run(f"{WIDER}({width})") == []
    assert browser.run("document.documentElement.scrollWidth") <= width
    assert browser.run(BROKEN) == 0 and browser.errors == []
    ground = browser.run("getComputedStyle(document.body).backgroundColor")
    for part in ("body", ".muted", "svg text", "nav a", "td .ends"):
        place = "fill" if "svg" in part else "color"
        ink = browser.run(f'getComputedStyle(document.querySelector("{part}")).{place}')
        assert contrast(ink, ground) > 4.5, part


NAMED = """(name) => document.querySelectorAll("tbody th, figcaption").forEach((e) => {
  e.textContent = name;
})"""


def test_a_long_name_breaks(report: Path, browser: Browser) -> None:
    """Of an external controller: no page is wider for it, and the ranking is whole on a desk."""
    for width in (320, 1400):
        browser.open(report, width)
        browser.run(f"({NAMED})('my_own_controller.py:WithStifferAnkles')")
        assert browser.run("document.documentElement.scrollWidth") <= width
    wider = (
        "((box) => box.scrollWidth - box.clientWidth)(document.querySelector('#ranking .scroll'))"
    )
    assert browser.run(wider) <= 0


def test_buttons_hide_sort_and_answer_keys(report: Path, browser: Browser) -> None:
    """A legend's button hides its series everywhere, a heading sorts; both by keyboard."""
    browser.errors.clear()
    browser.open(report)
    all_shown = 'getComputedStyle(g).display !== "none"'
    shown = f"[...document.querySelectorAll('.plot .series')].filter((g) => {all_shown}).length"
    before = browser.run(shown)
    browser.run('document.querySelector(".legend button").focus()')
    press(browser, "Enter", "\r")
    pressed = "document.querySelectorAll('.legend button[aria-pressed=false]').length"
    assert browser.run(shown) < before and browser.run(pressed) >= 1
    press(browser, "Enter", "\r")
    assert browser.run(shown) == before and browser.run(pressed) == 0

    names = '[...document.querySelectorAll("#ranking-table tbody th")].map((c) => c.textContent)'
    first = browser.run(names)
    browser.run('document.querySelectorAll("#ranking-table thead button")[1].focus()')
    press(browser, "Enter", "\r")
    assert browser.run(names) == sorted(first, reverse=True)
    press(browser, "Enter", "\r")
    assert browser.run(names) == sorted(first)
    assert browser.run('document.querySelector("th[aria-sort]").ariaSort') == "ascending"
    assert browser.errors == []


def press(browser: Browser, key: str, text: str) -> None:
    for kind in ("keyDown", "keyUp"):
        browser.call("Input.dispatchKeyEvent", type=kind, key=key, code=key, text=text,
                     windowsVirtualKeyCode=13)  # fmt: skip


def contrast(a: str, b: str) -> float:
    """WCAG's contrast of two CSS colours rgb(r, g, b)."""

    def luminance(colour: str) -> float:
        channels = [int(value) / 255 for value in re.findall(r"\d+", colour)[:3]]
        linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
        return sum(w * c for w, c in zip((0.2126, 0.7152, 0.0722), linear, strict=True))

    high, low = sorted((luminance(a), luminance(b)), reverse=True)
    return (high + 0.05) / (low + 0.05)
