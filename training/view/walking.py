"""Sliders for the command of controllers that walk."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import viser

from poise.baselines.walking.command import GaitCommand

#: field of a command → label, least, most and step of its slider, and how much 1 of it is
SLIDERS = {
    "ahead": ("Ahead [m/s]", -0.5, 1.1, 0.05, 1.0),
    "left": ("Left [m/s]", -0.3, 0.3, 0.05, 1.0),
    "turn": ("Turn left [°/s]", -30.0, 30.0, 1.0, math.pi / 180.0),
}


class WalkSliders:
    """A folder of the panel.

    `moved` is given the command when a user has moved a slider, at once and in a thread of the
    server: `tell` may otherwise put the slider back first.
    """

    def __init__(self, gui: viser.GuiApi, moved: Callable[[dict[str, float]], None]):
        self._moved = moved
        self._shown: GaitCommand | None = None
        self._folder: Any = gui.add_folder("Walk", visible=False)
        with self._folder:
            self.sliders: dict[str, Any] = {
                name: gui.add_slider(label, least, most, step, 0.0)
                for name, (label, least, most, step, _) in SLIDERS.items()
            }
        for slider in self.sliders.values():
            slider.on_update(self._updated)

    def _updated(self, event: Any) -> None:
        if event.client_id is not None:  # a user, not `tell`
            self._shown = None
            self._moved(self.fields())

    def set_visible(self, visible: bool) -> None:
        """Show the folder, or hide it."""
        self._folder.visible = visible

    def fields(self) -> dict[str, float]:
        """The command that the sliders describe: fields of `GaitCommand`."""
        return {
            name: round(float(self.sliders[name].value) * unit, 4)
            for name, (*_, unit) in SLIDERS.items()
        }

    def tell(self, gait: GaitCommand) -> None:
        """Show the command that holds, if it is another than before."""
        if gait == self._shown:
            return
        self._shown = gait
        for name, (_, least, most, step, unit) in SLIDERS.items():
            value = step * round(getattr(gait, name) / unit / step)
            self.sliders[name].value = min(max(value, least), most)


class Throttle:
    """Lets values through no more often than every `period` [s]; a slider gives many."""

    def __init__(self, period: float):
        self._period, self._last = period, -math.inf
        self.waiting: dict[str, float] | None = None  #: the newest value, until it is taken

    def take(self, now: float) -> dict[str, float] | None:
        """The value that waits, if the last one was taken long enough before `now` [s].

        Time may have begun anew since.
        """
        if self.waiting is None or abs(now - self._last) < self._period:
            return None
        value, self.waiting, self._last = self.waiting, None, now
        return value
