"""One walk: simulated with printed progress, filmed, and its figures in words."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from poise.baselines.allowance import allows
from poise.baselines.walking.config import WalkConfig
from poise.baselines.walking.planner.reach import check_command
from poise.baselines.walking.schedule import TimedCommand, parse_commands
from poise.baselines.walking.walk import allocate_gait, limits_of_legs
from poise.configs.errors import ConfigError, shown
from poise.configs.outputs import check_out_file
from poise.configs.problems import out_of_range
from poise.envs.balance.base import BalanceEnv
from poise.envs.physics.engines.config import load_physics
from poise.envs.physics.engines.engine import check_engine
from poise.envs.physics.pushes.push import Push
from poise.envs.robots.robot import Robot, load_robot
from poise.envs.sensing.realism import load_realism
from poise.envs.terrain.bumps import Bumps
from poise.envs.terrain.terrain import Terrain, make_terrain
from poise.envs.viewing.camera import Camera, beside
from poise.training.benchmarking.trials.agents import Agent, check_may_walk, check_walks, load_agent
from poise.training.benchmarking.trials.play import run_trial
from poise.training.benchmarking.trials.trial import Outcome, Trial
from poise.training.pictures.figures.encoder import check_video
from poise.training.pictures.figures.video import record

from .loading import read_pushes

EVERY = 5.0  # [s] between lines about a walk
Say = Callable[[str], object]  # prints a line


@allows("controller")
def play_walk(
    command: Mapping[str, float | None],
    *,
    duration: float = 20.0,
    controller: str = "walk",
    robot: str = "humanoid",
    terrain: str | Mapping[str, object] = "flat",
    realism: str | Path | None = None,
    physics: str | Path | None = None,
    push: str | None = None,
    push_at: float = 6.0,
    seed: int = 0,
    video: str | Path | None = None,
    say: Say = print,
    allow: str | Iterable[str] = (),
) -> Outcome:
    """Play one walk at a command and tell of it in lines; returns its outcome.

    Args:
        command: fields of a `GaitCommand`; of None its default.
        duration: of the walk [s].
        controller: one that walks, as `load_agent` takes it.
        robot: a packaged robot or a path to its description.
        terrain: a kind of terrain, or a mapping with its `kind`, see `make_terrain`.
        realism: a packaged realism level or a path to one; None: ideal.
        physics: a packaged engine or a path to its settings; None: MuJoCo.
        push: impulse [N·s] and direction [deg], such as "20@90", of a push of 0.1 s; None: none.
        push_at: the start of the push [s].
        seed: of the start, which is a little disturbed.
        video: an MP4 or WebP file to write.
        say: what prints the lines.
        allow: external controllers (``module:Class``) that may run.

    Raises:
        ConfigError: a number, a name or a file that is not valid; a controller that does not walk.
        PoiseError: nothing can be drawn or encoded here, or the file cannot be written.
    """
    if video is not None:
        check_video(video)
        check_out_file(video, "video")
    if seed < 0:
        raise out_of_range(seed, field="seed", least=0)
    loaded = load_robot(robot)
    commands = parse_commands(command, "command")
    pushes = () if push is None else (parse_push(push, push_at, duration, loaded),)
    ground = make_terrain(terrain, "walk")
    engine = load_physics(physics)
    check_engine(engine, loaded, ground)
    check_asked(controller, loaded, commands, ground)  # a controller takes long to be made
    agent = load_agent(
        controller, loaded, duration=duration, pushes=None, terrain=ground,
        realism=load_realism(realism), physics=engine,
    )  # fmt: skip
    check_walks(controller, agent, "walk")
    trial = Trial(0, seed, pushes, commands=commands)
    first = commands[0]
    say(f"{controller}, {loaded.name}: {first.ahead:g} m/s ahead, {first.left:g} left, "
        f"{np.degrees(first.turn):g} °/s for {duration:g} s")  # fmt: skip
    outcome = run_trial(agent, trial, WalkProgress(say))
    for line in lines(outcome, trial, agent):
        say(line)
    if video is not None:
        _film(agent, trial, video)
        say(str(video))
    return outcome


def check_asked(
    controller: str, robot: Robot, commands: Sequence[TimedCommand], terrain: Terrain
) -> None:
    """Raise ConfigError, as the controller itself would, if its description tells that it does not
    walk, or, of one that plans its steps, that `robot` cannot on level ground what is asked."""
    config = check_may_walk(controller, "walk")
    if isinstance(config, WalkConfig) and terrain.flat:
        gait, limits = config.gait, limits_of_legs(robot, config.gait)
        arrays = allocate_gait(gait, robot.units, limits)
        for command in commands:
            check_command(command, robot, arrays, limits or gait.limits, gait.swing)


def parse_push(text: str, start: float, duration: float, robot: Robot) -> Push:
    """The push of 0.1 s that "20@90" means: 20 N·s towards 90°, of the robot's first push body.

    A YAML mapping of a push's fields is taken, too, with its own start.

    Raises ConfigError for another form, numbers out of range, and a start after the `duration`.
    """
    if text.lstrip().startswith("{"):
        return read_pushes(text, robot)[0]
    try:
        numbers = [float(part) for part in text.split("@")]
    except ValueError:
        numbers = []
    if len(numbers) != 2:
        raise ConfigError(f"must be an impulse and a direction such as 20@90, not {shown(text)}",
                          field="push")  # fmt: skip
    if not 0.0 <= start < duration:
        raise ConfigError(f"must be within the {duration:g} s of the walk, not {start:g}",
                          field="push_at")  # fmt: skip
    return read_pushes(f"{text}@{start}", robot)[0]


class WalkProgress:
    """Print time and speed of a walk every few seconds; pass it to `run_trial`."""

    def __init__(self, say: Say):
        self._say, self._due = say, EVERY
        self._last: tuple[float, np.ndarray] | None = None

    def __call__(self, env: BalanceEnv) -> None:
        time, place = env.simulation.time, env.simulation.state.com[:2]
        if self._last is None:
            self._last = time, place.copy()
        if time < self._due - 1e-9:
            return
        before, start = self._last
        speed = float(np.linalg.norm(place - start)) / (time - before)
        self._say(f"{time:6.1f} s  {speed:.2f} m/s")
        self._last, self._due = (time, place.copy()), self._due + EVERY


def lines(outcome: Outcome, trial: Trial, agent: Agent) -> Iterator[str]:
    """Yield the figures of a walk in words."""
    o, end = outcome, agent.env.simulation.time
    yield f"fell after {o.fall_time:.1f} s" if o.fallen else f"upright after {end:.0f} s"
    if not o.fallen and o.surfaces_passed is None:
        yield said_of_end(o, trial)
    if o.speed_ahead is not None and o.speed_left is not None and o.turn_rate is not None:
        yield (f"speed: {o.speed_ahead:.3f} m/s ahead, {o.speed_left:.3f} left, "
               f"{np.degrees(o.turn_rate):.1f} °/s; error {o.speed_error:.3f}, "
               f"RMS {o.speed_error_rms:.3f} m/s")  # fmt: skip
    if o.step_length is not None:
        yield (f"steps: {o.steps}, {o.step_length:.3f} m long, {o.step_width:.3f} m wide, "
               f"{o.step_time:.2f} s each")  # fmt: skip
    if o.cost_of_transport is not None:
        yield (f"cost of transport: {o.cost_of_transport:.2f}, of positive work "
               f"{o.positive_cost_of_transport:.2f}")  # fmt: skip
    if o.knee_mean is not None:
        yield f"knee of the stance leg: {o.knee_mean:.2f} N·m/kg, at most {o.knee_peak:.2f}"
    if o.surfaces_passed is not None:
        terrain = agent.env.simulation.robot.terrain
        count = len(terrain.surfaces()) - 1
        # bumps lie about, in no order
        passed = "" if isinstance(terrain, Bumps) else f"passed {o.surfaces_passed} of {count}, "
        yield f"terrain: {passed}touched edges {o.edge_contacts} times"
    for push in trial.pushes:
        at = "" if o.push_phase is None else f", at {o.push_phase:.2f} of the stride"
        yield f"push: {push.impulse:g} N·s towards {push.direction:g}° at {push.start:g} s{at}"


def said_of_end(outcome: Outcome, trial: Trial) -> str:
    """Return whether a robot that has not fallen follows its command at the end, by the same
    criterion as `recovered`: a push is not charged with an error that was there before it."""
    held = "" if outcome.recovered else "not "
    if trial.command is None or not trial.command.array()[:3].any():
        return f"it is {held}at rest"
    if trial.pushes or trial.kicks:
        return f"the last two strides are {held}as near to the command as those before the push"
    return f"the last two strides are {held}as commanded"


def _film(agent: Agent, trial: Trial, path: str | Path) -> None:
    """Play the walk once more, and film it."""
    if agent.begin is not None:
        agent.begin()
    camera = Camera() if trial.push is None else beside(trial.push.direction)
    start = {"seed": trial.seed, "options": trial.options}
    record(agent.env, agent.act, path, start, camera=camera)
