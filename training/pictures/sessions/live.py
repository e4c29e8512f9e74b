"""Sources of frames: a running session or a recorded trial."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from types import MappingProxyType

from poise.baselines.balance.references.reference_motion import ReferenceMotion
from poise.baselines.balance.references.robot_clip import RobotClip
from poise.baselines.walking.planner.command import GaitCommand
from poise.baselines.walking.planner.reach import Reach
from poise.baselines.walking.schedule import TimedCommand
from poise.configs.errors import PoiseError
from poise.envs.physics.pushes.push import Push
from poise.envs.robots.robot import Robot

from .frames import Frame, FrameMaker
from .session import Session, load_player
from .spec import SessionSpec, TrialSpec

KEPT = 30.0  # [s] of a session that can be scrubbed through
LONGEST_FILM = 60.0  # [s]
Frames = tuple[Frame, ...]  # of all robots at one moment


class Live:
    """A session and the frames of its last seconds; `history[at]` is what is shown.

    Args:
        session: that goes on.
        spec: what it was loaded from.
        motion: that is performed; None: they stand.
        seen: postures that are seen as a ghost while they stand.

    Attributes:
        names: of the controllers.
        period: between two frames [s].
        live: whether it can be pushed.
        ended: whether there is nothing more to play.
        reasons: controller → why it lost a recorded trial.
    """

    live, ended = True, False
    reasons: Mapping[str, str] = MappingProxyType({})

    def __init__(
        self,
        session: Session,
        spec: SessionSpec | None = None,
        motion: ReferenceMotion | None = None,
        seen: RobotClip | None = None,
    ):
        names = tuple(session.names)
        self._spec = SessionSpec(names, session.robot.name) if spec is None else spec
        self.session, self._motion = session, motion
        self.names, self.robot, self.period = session.names, session.robot, session.period
        self._observers = [FrameMaker(side.env, seen) for side in session.sides]
        self._begin()

    @property
    def spec(self) -> SessionSpec:
        """What plays the same again: the same start, pushes and commands."""
        pushes = tuple(_push_text(push) for push in self.session.pushes)
        commands = tuple(_command_text(command) for command in self.session.commands)
        return replace(self._spec, pushes=pushes, commands=commands)

    @property
    def gait(self) -> GaitCommand | None:
        """The current command of the walking controllers; None if no controller walks."""
        return self.session.command if self.session.walks else None

    @property
    def reach(self) -> Reach | None:
        """The command range that all walking controllers share; None if one of them states none."""
        return self.session.reach

    @property
    def yaw(self) -> float:
        """Of the heading at the reset, which directions are relative to [rad]."""
        return self.session.sides[0].env.simulation.start_yaw

    def step(self) -> None:
        """Play a step of every controller; what is shown is the present again."""
        self.session.step()
        self._observe()

    def reset(self) -> None:
        """Start over."""
        self.session.reset()
        self._begin()

    def push(self, **fields: object) -> Push:
        """Push every robot; see `Session.push`."""
        return self.session.push(**fields)

    def walk(self, **fields: object) -> TimedCommand:
        """Command those that walk; see `Session.walk`."""
        return self.session.walk(**fields)

    def film(self, name: str, path: Path) -> None:
        """Play the same again by another agent, and write an MP4 of it.

        Raises PoiseError: nothing can be drawn or encoded here.
        """
        from poise.training.pictures.figures.video import record

        time = self.session.time
        if time == 0.0:
            raise PoiseError("nothing has been simulated that a video could show")
        if time > LONGEST_FILM:
            raise PoiseError(f"a video is of at most {LONGEST_FILM:g} s, start over with Reset")
        agent = load_player(name, self.robot, self._motion, time, self.spec.realism)
        trial = self.session.sides[self.names.index(name)].own(self.session.trial)
        if agent.begin is not None:
            agent.begin()
        record(agent.env, agent.act, path, {"seed": trial.seed, "options": trial.options})

    def _begin(self) -> None:
        self.history: list[Frames] = []
        self._observe()

    def _observe(self) -> None:
        sides = zip(self._observers, self.session.sides, strict=True)
        self.history.append(tuple(see(side.fall_time) for see, side in sides))
        del self.history[: -round(KEPT / self.period)]
        self.at = len(self.history) - 1


class Recorded:
    """Frames that were recorded before, see `recorded_trial`; attributes as of `Live`.

    `film` writes an MP4 of one controller.
    """

    live, yaw, gait, reach = False, 0.0, None, None

    def __init__(
        self, spec: TrialSpec, robot: Robot, history: Sequence[Frames], period: float,
        film: Callable[[str, Path], object], reasons: Mapping[str, str],
    ):  # fmt: skip
        self.spec, self.names = spec, list(spec.controllers)
        self.robot, self.period, self.reasons = robot, period, reasons
        self.history, self.at, self.film = history, 0, film

    @property
    def ended(self) -> bool:
        """Whether the last frame is shown."""
        return self.at == len(self.history) - 1

    def step(self) -> None:
        """Show the next frame, if there is one."""
        self.at = min(self.at + 1, len(self.history) - 1)

    def reset(self) -> None:
        """Show the first frame."""
        self.at = 0

    def push(self, **fields: object) -> Push:
        """Raises PoiseError: what is over cannot be pushed."""
        raise PoiseError("a recorded trial cannot be pushed, what poise view CONTROLLER plays can")

    def walk(self, **fields: object) -> TimedCommand:
        """Raises PoiseError: what is over takes no command."""
        raise PoiseError("a recorded trial takes no command, what poise view CONTROLLER plays does")


Play = Live | Recorded  # something with a timeline


def _push_text(push: Push) -> str:
    """Return a push as `--push` takes it, without what has its default."""
    x, y, z = push.point
    return _mapping(
        impulse=push.impulse,
        direction=push.direction,
        duration=push.duration,
        body=push.body,
        start=push.start,
        elevation=push.elevation or None,
        point=f"[{x}, {y}, {z}]" if any(push.point) else None,
        profile=None if push.profile == "square" else push.profile,
    )


def _command_text(command: TimedCommand) -> str:
    """Return a command as `--command` takes it, without what has its default."""
    return _mapping(**{name: value or None for name, value in asdict(command).items()})


def _mapping(**fields: object) -> str:
    """Return a YAML mapping on one line, of what is not None."""
    given = {name: value for name, value in fields.items() if value is not None}
    return "{" + ", ".join(f"{name}: {value}" for name, value in given.items()) + "}"
