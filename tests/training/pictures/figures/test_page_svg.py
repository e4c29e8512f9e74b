"""training/pictures/figures/page_svg.py: Matplotlib's drawings as parts of a page."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pytest

from poise.training.pictures.figures.page_svg import tag
from poise.training.pictures.figures.palette import BLUE, GREY
from poise.training.pictures.figures.style import (
    Inline,
    headline,
    legend_below,
    look,
    sample,
    saved_figure,
)
from tests.support.drawings import drawing, points


def square(out: Inline) -> None:
    """Axes of a known place in a picture of 100 by 100 points."""
    with saved_figure(out, 7.0, 7.0) as figure:
        figure.set_layout_engine("none")
        ax = figure.add_axes((0.1, 0.1, 0.8, 0.8))
        ax.set(xlim=(0, 1), ylim=(0, 1))
        ax.plot(
            [0, 0.5, np.nan, 1, 1],
            [0, 1, 1, 0, 1],
            color=BLUE,
            ls="--",
            lw=2,
            gid=tag(3, tip='<"&'),
        )
        ax.fill_between([0, 1], 0, [0, 1], color=GREY, alpha=0.25, lw=0, gid=tag(3, detail=True))
        ax.set_xlabel("right <b>")
        headline(figure, "A title", "a note")
        legend_below(figure)


def test_a_picture_is_where_the_data_are_in_colours_of_the_page() -> None:
    """A line breaks where there is nothing; ordinates grow downwards; groups have their words."""
    out = Inline('a "label" & more', width=100.0 / 72.0)
    square(out)
    root = drawing(out.svg)
    assert root.get("viewBox") == "0 0 100 100" and root.get("aria-label") == 'a "label" & more'
    area, line = (group for group in root.iter("g") if "series" in group.get("class", ""))
    assert line.get("data-series") == area.get("data-series") == "3"
    title, path = line
    assert title.tag == "title" and title.text == '<"&' and area.get("class") == "series detail"
    np.testing.assert_allclose(points(path), [(10, 90), (50, 10), (90, 90), (90, 10)], atol=0.1)
    assert path.get("d", "").count("M") == 2
    assert path.get("stroke") == "var(--s0)" and path.get("stroke-width") == "2"
    assert path.get("stroke-dasharray") and path.get("fill") == "none"
    assert area[0].get("fill") == "var(--muted)" and area[0].get("fill-opacity") == "0.25"
    np.testing.assert_allclose(points(area[0]).max(axis=0), (90, 90), atol=0.1)


def test_words_are_text_and_those_of_the_page_are_left_to_it() -> None:
    """In the page's font and colours; neither title nor legend; no id, nothing from elsewhere."""
    out = Inline()
    square(out)
    words = {element.text: element for element in drawing(out.svg).iter("text")}
    assert "right <b>" in words and "0.2" in words and not {"A title", "a note"} & set(words)
    assert words["right <b>"].get("text-anchor") == "middle"
    assert words["right <b>"].get("fill") == "var(--ink)" and "font-family" not in out.svg
    assert " id=" not in out.svg and "url(" not in out.svg and 'aria-hidden="true"' in out.svg


def test_the_same_drawing_gives_the_same_text() -> None:
    first, second = Inline(), Inline()
    square(first)
    square(second)
    assert first.svg == second.svg


@pytest.mark.parametrize("index", [0, 1, 9])
def test_a_sample_looks_as_its_series(index: int) -> None:
    """Its colour, its dashes, its mark in the middle."""
    root = ElementTree.fromstring(sample(*look(index)))
    line, mark = root.iter("path")
    assert line.get("stroke") == mark.get("fill") == f"var(--s{index % 8})"
    assert (line.get("stroke-dasharray") is None) == (look(index).line == "-")
    middle = 0.5 * (points(mark).min(axis=0) + points(mark).max(axis=0))
    np.testing.assert_allclose(middle, (15, 6), atol=1.0)
