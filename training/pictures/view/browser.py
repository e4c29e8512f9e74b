"""The page and the loop that plays: time, what the user asks for, pictures."""

import queue
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import viser

from poise.configs.errors import PoiseError, raised
from poise.envs.viewing.quantities import Quantity
from poise.training.pictures.sessions.frames import frame_between
from poise.training.pictures.sessions.live import Frames, Play
from poise.training.pictures.sessions.mouse import Pull
from poise.training.pictures.sessions.pace import RealTimePace
from poise.training.pictures.sessions.spec import SessionSpec, Spec, TrialSpec, choices, read_link

from .pages import Pages, send_films, send_picture
from .panel import OPACITY, Panel, Wishes, status
from .plots import Plots
from .stage import BACKGROUND, ViewStage, set_look
from .walking import Throttle

FRAME = 1.0 / 30.0  # [s] between two pictures
TELL = 0.25  # [s] between two looks at status and plots
COMMAND = 0.2  # [s] between two commands: a slider that is dragged asks for many
Load = Callable[[Spec], Play]
Job = Callable[[], None]


class BrowserView:
    """Run a session in a page until it is ended.

    Everything that is simulated happens in `run`, in the thread that calls it: what the page's
    threads want is put into a queue and done between two steps.

    Args:
        server: of the page.
        play: a session or a recorded trial.
        load: makes what another spec asks for.
        dark: whether the page is dark to begin with.
    """

    def __init__(self, server: viser.ViserServer, play: Play, load: Load, dark: bool = False):
        self._server, self._load, self._jobs = server, load, queue.SimpleQueue[Job]()
        self.pace, self.paused = RealTimePace(), False
        self._opacity, self._hidden, self._following = OPACITY, set[Quantity](), True
        self._sliders = Throttle(COMMAND)  # what they ask for
        self._drawn = self._shown = -1e9  # when the last picture and status were shown [s]
        self._set_dark(dark)
        wishes = Wishes(
            pause=self.toggle, step=self.step, reset=self.reset, speed=self.set_speed,
            seek=self.seek, push=self.push, walk=self.walk, load=self.load,
            open_trial=self.open_trial, show=self.show, follow=self._follow,
            opacity=self._set_opacity, dark=self._set_dark, picture=self._picture, film=self._film,
        )  # fmt: skip
        self.choices = choices(play.spec)
        self.panel = Panel(server.gui, self.ask, wishes, self.choices, play.live, dark)
        beside = server.gui.add_panel()
        self._tab = beside.add_tab("Over time", viser.Icon.CHART_LINE)
        beside.dock_left()
        beside.set_width(300)
        server.gui.main_panel.dock_right()
        self._pages = Pages(server, lambda: self.stage)
        self._seen = False  # by anybody
        server.on_client_connect(lambda _: self.ask(self._looked_at))
        self._set_play(play)

    def _set_play(self, play: Play) -> None:
        """Show this."""
        self.play = play
        grabbed = partial(self.ask, self._pulled)
        self.stage = ViewStage(self._server, play.robot, play.names, grabbed, self._opacity)
        self._pages.point_cameras()
        self.stage.marks.hidden, self.stage.following = self._hidden, self._following
        with self._tab:
            self.plots = Plots(self._server.gui, play.names)
        self.panel.set_up(play)
        self._changed()

    def ask(self, do: Callable[..., None], *arguments: object) -> None:
        """Have something done between two steps; from any thread."""
        self._jobs.put(lambda: do(*arguments))

    def run(self, seconds: float | None = None) -> None:
        """Play, for some seconds of the wall clock or until the process is stopped."""
        end = time.monotonic() + (float("inf") if seconds is None else seconds)
        self.pace = RealTimePace()
        while (now := time.monotonic()) < end:
            self._advance()
            if now - self._drawn >= FRAME:
                self._draw(now)
            self._wait(end)

    def toggle(self) -> None:
        """Pause, or go on; what has ended begins again."""
        self.paused = not self.paused
        if not self.paused and self.play.ended:
            self.play.reset()
        self._changed()

    def step(self) -> None:
        """Pause, and play one step."""
        self.paused = True
        self._give_command()
        self.play.step()
        self._changed()

    def reset(self) -> None:
        """Start over."""
        self._sliders.waiting = None
        self.play.reset()
        self._changed()

    def set_speed(self, speed: float) -> None:
        """Play `speed` simulated seconds in a second."""
        self.pace.speed = speed

    def seek(self, moment: float) -> None:
        """Pause, and show what was at a moment [s]."""
        history = self.play.history
        self.paused = True
        place = round((moment - history[0][0].time) / self.play.period)
        self.play.at = min(max(place, 0), len(history) - 1)
        self._changed()

    def push(self, fields: dict[str, object]) -> None:
        """Push every robot."""
        self.play.push(**fields)
        self.paused = False

    def walk(self, fields: dict[str, float]) -> None:
        """Tell those that walk a command, soon."""
        self._sliders.waiting = fields

    def load(self, robot: str, names: list[str], motion: str) -> None:
        """Play other controllers, another robot or another motion."""
        now = self.play.spec
        seed = now.seed if isinstance(now, SessionSpec) else 0
        self.open(SessionSpec(tuple(names), robot, motion, seed, allow=now.allow))

    def open_trial(self, trial: int) -> None:
        """Show another trial of the same result, by the same controllers."""
        if isinstance(self.play.spec, TrialSpec):
            self.open(replace(self.play.spec, trial=trial))

    def visited(self, query: str) -> None:
        """A page is opened whose address may be a link; called in the server's thread.

        Raises ConfigError for a link that is not valid.
        """
        spec = read_link(query, self.play.spec, self.choices.all)
        if spec is not None and spec != self.play.spec:
            self.ask(self.open, spec)

    def open(self, spec: Spec) -> None:
        """Play something else."""
        self._pages.say(f"loading {', '.join(spec.controllers)} …")
        play = self._load(spec)
        self.stage.remove()
        self.plots.remove()
        self._set_play(play)
        self.paused, self._sliders.waiting = False, None
        self.pace.rest()

    def _looked_at(self) -> None:
        """A recorded trial begins when the first page is opened: it may be over before."""
        if not self._seen and not self.play.live:
            self.paused = False
            self.reset()
        self._seen = True

    def _advance(self) -> None:
        """The steps that are due."""
        if self.paused:
            self.pace.rest()
            return
        self._attempt(self._play_due)
        if self.play.ended:
            self.paused = True

    def _play_due(self) -> None:
        self._give_command()
        for _ in range(self.pace.due(self.play.period)):
            self.play.step()

    def _give_command(self) -> None:
        """Command the sliders' velocity, if the last command is old enough."""
        fields = self._sliders.take(self.play.history[-1][0].time)
        if fields is not None:
            self.play.walk(**fields)

    def _attempt(self, job: Job) -> None:
        """Run a job; show the error that it raises, and keep the page running."""
        try:
            job()
        except PoiseError as error:
            self._pages.say(str(error), "red")
        except Exception as error:  # an external controller, or a page that is not ours
            self.paused = True
            self._pages.say(raised(error), "red")

    def _draw(self, now: float) -> None:
        self._drawn = now
        self.stage.show(self._frames())
        if self._floor.position[2] != self.stage.floor:
            self._floor.position = (0.0, 0.0, self.stage.floor)
        if now - self._shown >= TELL:
            self._shown = now
            history = self.play.history
            at, first, last = (history[k][0].time for k in (self.play.at, 0, -1))
            pulled = None if self.stage.pull is None else self._push_of(self.stage.pull)
            text = status(self.play, self.paused, self.pace, pulled)
            self.panel.tell(text, self.paused, at, first, last)
            waits = self._sliders.waiting is not None
            self.panel.tell_how(self.play.spec, None if waits else self.play.gait)
            self.plots.show(history, self.play.at, self.play.period)

    def _frames(self) -> Frames:
        """Return what is shown now: in slow motion interpolated towards the last step's end."""
        history, at = self.play.history, self.play.at
        if self.paused or self.pace.speed >= 1.0 or at == 0:
            return history[at]
        pairs = zip(history[at - 1], history[at], strict=True)
        return tuple(frame_between(first, second, self.pace.phase) for first, second in pairs)

    def _changed(self) -> None:
        """Redraw everything in the next picture."""
        self._drawn = self._shown = -1e9

    def _wait(self, end: float) -> None:
        """Do what is asked; or wait for it until the next step or picture is due."""
        due = FRAME if self.paused else self.pace.until_due(self.play.period)
        now = time.monotonic()
        timeout = min(due, max(self._drawn + FRAME - now, 0.0), max(end - now, 0.0))
        try:
            job = self._jobs.get(timeout=timeout) if timeout > 0.0 else self._jobs.get_nowait()
        except queue.Empty:
            return
        self._attempt(job)
        if self.paused:
            self.pace.rest()

    def _pulled(self, phase: str, pulled: Pull) -> None:
        """A body is dragged, or let go of."""
        self.stage.pull = None if phase == "end" else pulled
        if phase == "end":
            self.push(self._push_of(pulled))

    def _push_of(self, pulled: Pull) -> dict[str, object]:
        """Return the push that the arrow of the mouse is."""
        return pulled.fields(self.play.robot, self.play.yaw, float(self.panel.duration.value))

    def show(self, quantity: Quantity, shown: bool) -> None:
        """Show the marks of a quantity, or hide them."""
        (self._hidden.discard if shown else self._hidden.add)(quantity)

    def _follow(self, follow: bool) -> None:
        self._following = self.stage.following = follow

    def _set_opacity(self, opacity: float) -> None:
        self._opacity = opacity
        self.stage.robots.set_opacity(opacity)

    def _set_dark(self, dark: bool) -> None:
        self._dark = dark
        self._floor = set_look(self._server, dark)

    def _picture(self, client: int) -> None:
        """In a thread of the server: it waits for the browser."""
        self._pages.say("the browser draws the picture …")
        try:
            send_picture(self._server, client, BACKGROUND[self._dark])
        except (RuntimeError, TimeoutError) as error:  # viser's, of a page that draws nothing
            self._pages.say(f"no picture came: {error}", "red")

    def _film(self, client: int) -> None:
        self._pages.say("writing the video; the simulation waits …")
        send_films(self._server, client, self.play)
        self.pace.rest()
