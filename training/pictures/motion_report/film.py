"""A performance as a video: the robot, and where it is if it follows its motion exactly."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

from poise.envs.balance.base import BalanceEnv
from poise.envs.viewing.renderer import SceneRenderer
from poise.training.benchmarking.trials.play import Watch
from poise.training.benchmarking.trials.trial import Trial
from poise.training.pictures.figures.encoder import encoded
from poise.training.pictures.figures.video import usual
from poise.training.pictures.sessions.ghost import Ghost, ghost_of


class MotionFilm(ExitStack):
    """Films the first trial of `follow`, which calls it; use as a context, which writes the file.

    Args:
        path: of the .mp4 or .webp file.
        size: width and height [pixels], even.
        others: another watch that is also called for every trial.

    Attributes:
        frames: how many have been written.
        rate: how many there are a second of the motion [1/s].
    """

    def __init__(
        self, path: Path, size: tuple[int, int] = (640, 480),
        others: Callable[[Trial], Watch] | None = None,
    ):  # fmt: skip
        super().__init__()
        self.path, self.size, self.others = path, size, others
        self.rate = usual(path)[1]
        self.frames, self._first = 0, True
        self._renderer: SceneRenderer | None = None
        self._ghost: Ghost | None = None

    def __enter__(self) -> MotionFilm:
        self._send = self.enter_context(encoded(self.path, self.size, self.rate))
        return self

    def __call__(self, trial: Trial) -> Watch:
        """What watches a trial."""
        more = None if self.others is None else self.others(trial)
        films, self._first = self._first, False

        def watch(env: BalanceEnv) -> None:
            if more is not None:
                more(env)
            if films:
                self._shoot(env)

        return watch

    def _shoot(self, env: BalanceEnv) -> None:
        """Film a moment, if it is one that the video has a frame of."""
        if self._renderer is None:
            width, height = self.size
            self._renderer = SceneRenderer(env.simulation, False, width, height)
            self.callback(self._renderer.close)
            self._ghost = ghost_of(env)
        if env.simulation.time < self.frames / self.rate - 1e-9:
            return
        time = float(getattr(env, "motion_time", env.simulation.time))
        posture = None if self._ghost is None else self._ghost.posture(time)
        frame = self._renderer.render(posture)
        assert frame is not None  # it is open, and off-screen
        self._send(frame)
        self.frames += 1
