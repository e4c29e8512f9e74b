"""training/pictures/figures/palette.py: one table of colours, readable on light and dark cards."""

from __future__ import annotations

import pytest
from matplotlib.colors import to_rgb

from poise.envs.viewing.quantities import CAPTURE_POINT, COP
from poise.training.pictures.figures.palette import (
    CARDS,
    CONTRAST,
    GREY,
    SERIES,
    contrast,
    readable,
    themed,
    variables,
)
from poise.training.pictures.figures.style import look


@pytest.mark.parametrize("scheme", CARDS)
def test_every_colour_stands_out_from_its_card(scheme: str) -> None:
    """And no two are the same, so that as many series are told apart as there are variables."""
    found = variables(scheme)
    series = [found[f"s{k}"] for k in range(len(SERIES))]
    assert len(set(series)) == len(SERIES)
    for name, value in found.items():
        assert contrast(to_rgb(value), to_rgb(CARDS[scheme])) >= CONTRAST - 0.05, name


def test_a_colour_that_can_be_read_is_that_of_all_pictures() -> None:
    light = variables("light")
    assert light["s0"] == look(0).colour.lower() and light["s1"] == look(1).colour.lower()
    assert light["cop"] == COP.hexadecimal.lower()
    assert light["capture"] == CAPTURE_POINT.hexadecimal.lower()


def test_a_colour_keeps_its_hue() -> None:
    """Mixed with black as little as will do, or with white on dark ground."""
    amber = to_rgb("#E69F00")
    darker = readable(amber, (1.0, 1.0, 1.0))
    fraction = darker[0] / amber[0]
    assert 0.7 < fraction < 1.0 and darker[1] == pytest.approx(fraction * amber[1])
    assert contrast(darker, (1.0, 1.0, 1.0)) == pytest.approx(3.0, abs=0.1)
    assert readable(amber, (0.0, 0.0, 0.0)) == amber
    assert contrast((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)) == pytest.approx(21.0)


def test_a_colour_of_a_picture_is_a_variable_of_the_page() -> None:
    """All series, the words, the lines of axes; a colour of nothing is as it is."""
    assert [themed(to_rgb(look(k).colour)) for k in range(8)] == [f"var(--s{k})" for k in range(8)]
    assert themed(to_rgb(GREY)) == "var(--muted)" and themed(to_rgb("white")) == "var(--card)"
    assert themed((0.5, 0.25, 0.0)) == "#804000"
