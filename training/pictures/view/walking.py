"""Sliders for the command of controllers that walk."""

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import viser

from poise.baselines.walking.planner.command import GaitCommand
from poise.baselines.walking.planner.reach import Reach

#: field of a command → label, least, most and step of its slider, and how much 1 of it is; a
#: robot's reach may be narrower
VELOCITY = {
    "ahead": ("Ahead [m/s]", -0.5, 1.1, 0.05, 1.0),
    "left": ("Left [m/s]", -0.3, 0.3, 0.05, 1.0),
    "turn": ("Turn left [°/s]", -30.0, 30.0, 1.0, math.pi / 180.0),
}
STEPS = {
    "width": ("Width [m]", 0.0, 1.0, 0.005, 1.0),
    "clearance": ("Clearance [m]", 0.0, 1.0, 0.005, 1.0),
    "step_length": ("Step length [m]", 0.0, 1.0, 0.01, 1.0),
    "arm_swing": ("Arm swing [°]", 0.0, 90.0, 1.0, math.pi / 180.0),
}
SLIDERS = {**VELOCITY, **STEPS}
LEAST = {"clearance": 0.005, "step_length": 0.05}  # [m] what a command of a length may not be below


class WalkSliders:
    """A folder of the panel.

    The sliders of steps show what the gait does by itself until a user moves them: what was not
    moved is not commanded.

    `moved` is given the command when a user has moved a slider, at once and in a thread of the
    server: `tell` may otherwise put the slider back first.
    """

    def __init__(self, gui: viser.GuiApi, moved: Callable[[dict[str, float]], None]):
        self._moved = moved
        self._shown: GaitCommand | None = None
        self._reach: Reach | None = None
        self._commanded: set[str] = set()  # of STEPS
        self._folder: Any = gui.add_folder("Walk", visible=False)
        with self._folder:
            self.sliders: dict[str, Any] = {
                name: gui.add_slider(label, least, most, step, max(least, 0.0))
                for name, (label, least, most, step, _) in SLIDERS.items()
            }
            self.own: Any = gui.add_button("Steps of its own", icon=viser.Icon.WALK)
        for name, slider in self.sliders.items():
            slider.on_update(partial(self._updated, name))
        self.own.on_click(self._give_back)

    def set_up(self, gait: GaitCommand | None, reach: Reach | None) -> None:
        """Offer what this robot can do; no `gait`: nothing walks; no `reach`: steps are its own."""
        self._folder.visible = gait is not None
        self._reach, self._shown, self._commanded = reach, None, set()
        for name in SLIDERS:
            least, most = _ends(name, reach)
            slider = self.sliders[name]
            slider.visible = most > least and (name in VELOCITY or reach is not None)
            if slider.visible:
                slider.max, slider.min = most, least
                slider.value = min(max(slider.value, least), most)
        self.own.visible = reach is not None

    def fields(self) -> dict[str, float]:
        """Return the command that the sliders describe: fields of `GaitCommand`."""
        values = {name: self._value(name) for name in VELOCITY}
        values |= {name: self._value(name) for name in STEPS if name in self._commanded}
        if not (values["ahead"] or values["left"]):
            values.pop("step_length", None)  # nothing that stands has one
        return values

    def tell(self, gait: GaitCommand) -> None:
        """Show the command that holds, if it is another than before."""
        if gait == self._shown:
            return
        self._shown = gait
        given = {name: getattr(gait, name) for name in SLIDERS}
        self._commanded = {name for name in STEPS if given[name]}
        for name, value in {**self._own(gait), **{n: v for n, v in given.items() if v}}.items():
            slider, (*_, step, unit) = self.sliders[name], SLIDERS[name]
            slider.value = min(max(step * round(value / unit / step), slider.min), slider.max)

    def _own(self, gait: GaitCommand) -> dict[str, float]:
        """What holds where nothing is commanded."""
        own = dict.fromkeys(VELOCITY, 0.0)
        if self._reach is not None:
            period = self._reach.period
            if gait.step_time is not None:
                period += gait.step_time - self._reach.step_time
            own |= {"width": self._reach.own_width, "clearance": self._reach.own_clearance,
                    "step_length": gait.speed * period, "arm_swing": 0.0}  # fmt: skip
        return own

    def _value(self, name: str) -> float:
        return round(float(self.sliders[name].value) * SLIDERS[name][-1], 4)

    def _updated(self, name: str, event: Any) -> None:
        if event.client_id is None:  # `tell`, not a user
            return
        if name in STEPS:
            self._commanded.add(name)
        self._ask()

    def _give_back(self, event: Any) -> None:
        """Let the gait choose its steps again."""
        self._commanded.clear()
        self._ask()

    def _ask(self) -> None:
        self._shown = None
        self._moved(self.fields())


def _ends(name: str, reach: Reach | None) -> tuple[float, float]:
    """Return the least and the most of a slider, which are multiples of its step."""
    _, least, most, step, unit = SLIDERS[name]
    low, high = getattr(reach, name, (-math.inf, math.inf))
    least = max(least, low / unit, LEAST.get(name, -math.inf))
    most = min(most, high / unit)
    return step * math.ceil(least / step - 1e-6), step * math.floor(most / step + 1e-6)


class Throttle:
    """Lets values through no more often than every `period` [s]; a slider gives many."""

    def __init__(self, period: float):
        self._period, self._last = period, -math.inf
        self.waiting: dict[str, float] | None = None  #: the newest value, until it is taken

    def take(self, now: float) -> dict[str, float] | None:
        """Return the pending value, if the last one was taken long enough before `now` [s].

        Time may have restarted since.
        """
        if self.waiting is None or abs(now - self._last) < self._period:
            return None
        value, self.waiting, self._last = self.waiting, None, now
        return value
