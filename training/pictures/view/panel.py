"""The controls beside the scene. They only ask: what is asked is done between two steps."""

import html
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import viser

from poise.baselines.walking.planner.command import GaitCommand
from poise.configs.texts import code, plain
from poise.envs.physics.pushes.options import body_names
from poise.envs.viewing.quantities import QUANTITIES, Quantity
from poise.training.pictures.sessions.live import Play
from poise.training.pictures.sessions.mouse import DURATION, WEIGHT
from poise.training.pictures.sessions.pace import RealTimePace
from poise.training.pictures.sessions.spec import MOST, NO_CONTROLLER, Choices, Spec, TrialSpec

from .walking import WalkSliders

SPEEDS = {"1×": 1.0, "1/2×": 0.5, "1/4×": 0.25, "1/10×": 0.1}  # label → simulated over real time
OPACITY = 0.75  # of the robot, with which marks inside are seen
#: A page may write to the clipboard on localhost and by https alone; by another name it copies
#: what it has selected, which any browser allows. The link itself is there where both fail.
LINK = """<div style="font-size: 0.85em; padding: 0 0.75em"><a href="{link}">Link to this</a>
<button style="margin-left: 0.5em; cursor: pointer" onclick="
const button = this, link = button.previousElementSibling.href;
const tell = done => {{ button.innerText = done ? 'Copied' : 'Refused: copy the link itself'; }};
const select = () => {{
  const area = document.createElement('textarea');
  area.value = link; button.after(area); area.select();
  try {{ return document.execCommand('copy'); }} finally {{ area.remove(); }}
}};
const other = () => tell(select());
navigator.clipboard ? navigator.clipboard.writeText(link).then(() => tell(true), other) : other();
">Copy</button></div>"""
Ask = Callable[..., None]  # has a function called with arguments, by the loop that plays


@dataclass
class Wishes:
    """What the controls may ask for: functions of the loop that plays."""

    pause: Callable[[], None]
    step: Callable[[], None]
    reset: Callable[[], None]
    speed: Callable[[float], None]
    seek: Callable[[float], None]
    push: Callable[[dict[str, object]], None]
    walk: Callable[[dict[str, float]], None]
    load: Callable[[str, list[str], str], None]
    open_trial: Callable[[int], None]
    show: Callable[[Quantity, bool], None]
    opacity: Callable[[float], None]
    follow: Callable[[bool], None]
    dark: Callable[[bool], None]
    picture: Callable[[int], None]
    film: Callable[[int], None]


class Panel:
    """The main panel of the page.

    Args:
        gui: of the server.
        ask: has a wish done by the loop; callbacks run in threads of the server.
        wishes: what there is to ask for.
        choices: names of robots, controllers and motions.
        live: whether pushes and controllers can be chosen: not in a recorded trial.
        dark: whether the page is dark to begin with.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        ask: Ask,
        wishes: Wishes,
        choices: Choices,
        live: bool,
        dark: bool,
    ):
        self._gui, self._ask, self.wishes, self.choices = gui, ask, wishes, choices
        self.status = gui.add_markdown("")
        self._playing()
        with gui.add_folder("Trial of the result", visible=not live):
            self._picking()
        self.walk = WalkSliders(gui, wishes.walk)
        with gui.add_folder("Push", visible=live):
            self._pushing()
        with gui.add_folder("Robot and controllers", expand_by_default=False, visible=live):
            self._choosing()
        with gui.add_folder("Show", expand_by_default=False):
            self._showing(dark)
        with gui.add_folder("Save", expand_by_default=False):
            self._saving()

    def set_up(self, play: Play) -> None:
        """Set the choices of this robot and of the running session."""
        bodies, spec = body_names(play.robot), play.spec
        self.body.options = bodies
        self.body.value = "torso" if "torso" in bodies else bodies[0]
        self.impulse.value = round(WEIGHT * play.robot.mass, 1)
        self.walk.set_up(play.gait, play.reach)
        if isinstance(spec, TrialSpec):
            self.trial.value = spec.trial
            return
        for choice, name in ((self.robot, spec.robot), (self.motion, spec.motion)):
            if name in choice.options:
                choice.value = name
        for k, choice in enumerate(self.controllers):
            name = spec.controllers[k] if k < len(spec.controllers) else NO_CONTROLLER
            choice.value = name if name in choice.options else NO_CONTROLLER

    def tell_how(self, spec: Spec, gait: GaitCommand | None) -> None:
        """Bring the command line, the link and, with a `gait`, its sliders up to date."""
        self.command.content = code(spec.command)
        self.link.content = LINK.format(link=html.escape(spec.link))
        if gait is not None:
            self.walk.tell(gait)

    def tell(self, text: str, paused: bool, at: float, first: float, last: float) -> None:
        """Bring the status, the button and the timeline [s] up to date."""
        self.status.content = text
        if self.pause.label != (label := "Play" if paused else "Pause"):
            self.pause.label = label
            self.pause.icon = viser.Icon.PLAYER_PLAY if paused else viser.Icon.PLAYER_PAUSE
        if last > first:
            self.timeline.max, self.timeline.min = last, first
            self.timeline.value = min(max(at, first), last)

    def _playing(self) -> None:
        gui = self._gui
        self.pause: Any = gui.add_button("Pause", icon=viser.Icon.PLAYER_PAUSE)
        self.pause.on_click(self._asked(lambda _: self.wishes.pause()))
        buttons = gui.add_button_group("Time", ("Step", "Reset"))
        buttons.on_click(self._asked(self._step_or_reset))
        speed = gui.add_dropdown("Speed", tuple(SPEEDS), initial_value="1×")
        speed.on_update(self._asked(lambda e: self.wishes.speed(SPEEDS.get(e.target.value, 1.0))))
        self.timeline: Any = gui.add_slider("Time [s]", 0.0, 0.02, 0.02, 0.0)
        self.timeline.on_update(self._asked(self._seek, users=True))

    def _step_or_reset(self, event: Any) -> None:
        (self.wishes.step if event.target.value == "Step" else self.wishes.reset)()

    def _seek(self, event: Any) -> None:
        self.wishes.seek(float(event.target.value))

    def _picking(self) -> None:
        self.trial: Any = self._gui.add_number("Trial", 0, min=0, step=1)
        button = self._gui.add_button("Show this trial")
        button.on_click(self._asked(lambda _: self.wishes.open_trial(int(self.trial.value))))

    def _pushing(self) -> None:
        gui = self._gui
        self.impulse: Any = gui.add_number("Impulse [N·s]", 20.0, min=0.0, max=1000.0, step=1.0)
        self.direction = gui.add_slider(
            "Direction [°]", -180.0, 180.0, 5.0, 0.0,
            hint="Counter-clockwise from forward: 0 forward, 90 left, 180 backward",
        )  # fmt: skip
        self.duration = gui.add_number("Duration [s]", DURATION, min=0.01, max=5.0, step=0.01)
        self.body: Any = gui.add_dropdown("Body", ("torso",))
        button = gui.add_button("Push", icon=viser.Icon.HAND_MOVE, color="orange")
        button.on_click(self._asked(lambda _: self.wishes.push(self.fields())))
        gui.add_markdown("Or drag a body with the mouse, and let go: the arrow is the push.")

    def fields(self) -> dict[str, object]:
        """The push that the controls describe, as `parse_pushes` takes it, without a start."""
        return {
            "impulse": float(self.impulse.value), "direction": float(self.direction.value),
            "duration": float(self.duration.value), "body": str(self.body.value),
        }  # fmt: skip

    def _choosing(self) -> None:
        gui = self._gui
        self.robot: Any = gui.add_dropdown("Robot", self.choices.robots)
        names = self.choices.controllers
        self.controllers: list[Any] = [
            gui.add_dropdown(f"Controller {k + 1}", names if k == 0 else (NO_CONTROLLER, *names))
            for k in range(MOST)
        ]
        self.motion: Any = gui.add_dropdown("Motion", self.choices.motions)
        gui.add_button("Load").on_click(self._asked(lambda _: self.load()))

    def load(self) -> None:
        """Ask for what is chosen."""
        # the server takes any value from a page: only names that are offered are loaded
        chosen = [choice.value for choice in self.controllers]
        names = [name for name in chosen if name in self.choices.controllers]
        robot, motion = self.robot.value, self.motion.value
        if names and robot in self.choices.robots and motion in self.choices.motions:
            self.wishes.load(robot, names, motion)

    def _showing(self, dark: bool) -> None:
        gui, wishes = self._gui, self.wishes
        for quantity in QUANTITIES:
            box = gui.add_checkbox(quantity.label, True)
            box.on_update(self._asked(partial(self._show, quantity)))
        opacity = gui.add_slider("Robot's opacity", 0.1, 1.0, 0.05, OPACITY)
        opacity.on_update(self._asked(lambda e: wishes.opacity(float(e.target.value))))
        follow = gui.add_checkbox("follow the robot", True)
        follow.on_update(self._asked(lambda e: wishes.follow(bool(e.target.value))))
        night = gui.add_checkbox("dark", dark)
        night.on_update(self._asked(lambda e: wishes.dark(bool(e.target.value))))

    def _show(self, quantity: Quantity, event: Any) -> None:
        self.wishes.show(quantity, bool(event.target.value))

    def _saving(self) -> None:
        gui, wishes = self._gui, self.wishes
        picture = gui.add_button("Picture (PNG)", icon=viser.Icon.CAMERA)
        picture.on_click(self._draw)
        film = gui.add_button("Video (MP4)", icon=viser.Icon.MOVIE)
        film.on_click(self._asked(lambda e: wishes.film(e.client_id)))
        self.link = gui.add_html("")
        self.command = gui.add_markdown("")

    def _draw(self, event: Any) -> None:
        self.wishes.picture(event.client_id)  # waits for the browser, in a thread of the server

    def _asked(self, do: Callable[[Any], None], users: bool = False) -> Callable[[Any], None]:
        """A callback that has the loop call `do`; with `users` only for what a user has done."""

        def callback(event: Any) -> None:
            if not (users and event.client_id is None):
                self._ask(do, event)

        return callback


def status(
    play: Play, paused: bool, pace: RealTimePace, pulled: Mapping[str, object] | None = None
) -> str:
    """What stands above the controls: time, how near to real time it is, who has fallen, and why.

    While a body is dragged, `pulled` are the fields of the push that it would be.
    """
    frames = play.history[play.at]
    factor = "paused" if paused else f"**{pace.factor:.2f} × real time**"
    if pace.speed != 1.0:
        factor += f" at {pace.speed:g} ×"
    lines = [f"{frames[0].time:.2f} s, {factor}"]
    for name, frame in zip(play.names, frames, strict=True):
        fell = None if frame.fall_time is None else f"fell at {frame.fall_time:.2f} s"
        lines.append(f"{code(name)}: {fell or 'on its feet'}")
        if play.ended and name in play.reasons:
            lines.append(f"*{plain(play.reasons[name])}*")
    if pulled is not None:
        lines.append(f"**{pulled['impulse']} N·s** towards {pulled['direction']}°")
    return "  \n".join(lines)
