"""The colours of all pictures, and in pages, where they are variables for light and dark."""

from collections.abc import Sequence

import numpy as np
from matplotlib.colors import to_hex, to_rgb

from poise.envs.viewing.quantities import CAPTURE_POINT, COM, COP, RGB

# Okabe and Ito's palette: distinguishable with any colour vision. Line and marker repeat the
# colour's meaning, for prints in grey.
BLUE, ORANGE, GREEN, PURPLE, SKY = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9"
AMBER = "#E69F00"
SERIES = (BLUE, ORANGE, GREEN, PURPLE, AMBER, SKY, "#6250B5", "#B3263E")  # violet and crimson last
INK, GREY, PALE = "#222222", "#767676", "#E4E4E4"

CARDS = {"light": "#ffffff", "dark": "#1a1e22"}  # scheme → what is drawn on, as in report.css
CONTRAST = 3.0  # to the card: WCAG's least for graphics
VARIABLES = {"com": COM, "cop": COP, "capture": CAPTURE_POINT}
DRAWN = {f"s{k}": to_rgb(colour) for k, colour in enumerate(SERIES)} | {
    name: quantity.colour for name, quantity in VARIABLES.items()
}  # variable → colour of a series or a quantity
ROLES = {"card": "white", "ink": INK, "muted": GREY, "rule": PALE}  # report.css gives both schemes
NAMES = {to_hex(colour): name for name, colour in reversed(DRAWN.items())} | {
    to_hex(to_rgb(colour)): name for name, colour in ROLES.items()
}


def themed(colour: Sequence[float]) -> str:
    """Return a colour of a picture as the style sheet's variable, if one stands for it."""
    red, green, blue = colour[:3]
    value = to_hex((red, green, blue))
    return f"var(--{NAMES[value]})" if value in NAMES else value


def variables(scheme: str) -> dict[str, str]:
    """CSS variable → colour, of a scheme of `CARDS`: series s0, s1, … and quantities."""
    card = to_rgb(CARDS[scheme])
    return {name: to_hex(readable(colour, card)) for name, colour in DRAWN.items()}


def readable(colour: RGB, ground: RGB) -> RGB:
    """A colour, mixed with black on light ground or with white on dark as far as it must be to have
    WCAG's `CONTRAST` to it. Both are parts of 0 to 1."""
    end = 0.0 if luminance(ground) > 0.18 else 1.0
    for percent in range(101):
        r, g, b = (part + 0.01 * percent * (end - part) for part in colour)
        if contrast((r, g, b), ground) >= CONTRAST:
            break
    return r, g, b


def contrast(first: RGB, second: RGB) -> float:
    """Return WCAG's contrast of two colours, 1 to 21."""
    low, high = sorted((luminance(first), luminance(second)))
    return (high + 0.05) / (low + 0.05)


def luminance(colour: RGB) -> float:
    """Return WCAG's relative luminance, 0 to 1."""
    return float(linear_rgb(colour) @ [0.2126, 0.7152, 0.0722])


def linear_rgb(colour: Sequence[float]) -> np.ndarray:
    """Return an sRGB colour (3,) as light adds up; both of 0 to 1."""
    c = np.asarray(colour, dtype=float)
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
