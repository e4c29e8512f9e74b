"""The colour of every quantity that is drawn, in pictures, videos and the viewer alike.

The colours are from Okabe and Ito's palette, distinct with any colour vision. What has one of
them in a picture means this quantity and nothing else.
"""

from typing import NamedTuple

RGB = tuple[float, float, float]  # of 0 to 1


class Quantity(NamedTuple):
    """A quantity that is drawn."""

    label: str  #: what people read
    colour: RGB  #: of its marks, and of its lines over time

    @property
    def hexadecimal(self) -> str:
        """The colour as #RRGGBB, for plots and web pages."""
        return "#" + "".join(f"{round(255 * part):02X}" for part in self.colour)


PUSH = Quantity("push", (0.902, 0.624, 0.0))  # amber
COM = Quantity("centre of mass", (0.05, 0.05, 0.05))  # black
COP = Quantity("centre of pressure", (0.835, 0.369, 0.0))  # vermilion
CAPTURE_POINT = Quantity("capture point", (0.0, 0.447, 0.698))  # blue
SUPPORT = Quantity("support polygon", (0.0, 0.62, 0.451))  # bluish green
CONTACT_FORCE = Quantity("contact forces", (0.8, 0.475, 0.655))  # reddish purple
FOOTHOLD = Quantity("planned foothold", (0.337, 0.706, 0.914))  # sky blue
REFERENCE = Quantity("reference motion", (0.941, 0.894, 0.259))  # yellow, a robot

#: in the order in which people choose among them
QUANTITIES = (PUSH, COM, COP, CAPTURE_POINT, SUPPORT, CONTACT_FORCE, FOOTHOLD, REFERENCE)
