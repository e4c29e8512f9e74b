"""view: the button that copies a link, where a page may write to the clipboard and not."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("viser", reason="not installed: pip install 'poise[view]'")

from poise.training.pictures.view.panel import LINK
from tests.support.browser import CHROMIUM, Browser

TARGET = "http://somewhere:8080/?controller=walk&seed=3"
SEEN = "addEventListener('copy', () => window.copied = document.activeElement.value)"

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed")


@pytest.fixture
def page(tmp_path: Path) -> Iterator[Browser]:
    """A file of the button alone, which notes what is copied from a selection."""
    file = tmp_path / "link.html"
    link = LINK.format(link=TARGET.replace("&", "&amp;"))
    file.write_text(f"<!doctype html><title>link</title><script>{SEEN}</script><body>{link}")
    with Browser() as browser:
        browser.open(file)
        yield browser


def copied(page: Browser) -> None:
    page.click("Copy")
    page.wait("document.querySelector('button').innerText == 'Copied'")
    assert page.run("!document.querySelector('textarea')") and page.errors == []


def test_the_clipboard_is_written(page: Browser, tmp_path: Path) -> None:
    """Where the browser allows it: nothing is selected for it."""
    page.save_to(tmp_path)
    copied(page)
    assert page.run("window.copied") is None
    assert page.run("navigator.clipboard.readText()") == TARGET


@pytest.mark.parametrize("without", ["undefined", "{writeText: () => Promise.reject('no')}"])
def test_a_selection_is_copied(page: Browser, without: str) -> None:
    """By another name than localhost there is no clipboard; a browser may refuse one, too."""
    page.run(f"Object.defineProperty(navigator, 'clipboard', {{value: {without}}}) && true")
    copied(page)
    assert page.run("window.copied") == TARGET


def test_a_refusal_is_told(page: Browser) -> None:
    """The link itself can then be copied by hand."""
    page.run("Object.defineProperty(navigator, 'clipboard', {value: undefined}) && true")
    page.run("void (document.execCommand = () => false)")
    page.click("Copy")
    page.wait("document.querySelector('button').innerText.startsWith('Refused')")
