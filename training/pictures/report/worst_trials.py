"""Choose the trials that a report shows and simulate them again: frames and signals."""

import io
import math
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass

import numpy as np

from poise.configs.errors import PoiseError
from poise.envs.balance.base import BalanceEnv
from poise.envs.viewing.camera import Camera, beside
from poise.envs.viewing.renderer import SceneRenderer
from poise.training.benchmarking.results.read import Record, Results
from poise.training.benchmarking.results.replay import replay
from poise.training.benchmarking.trials.signals import TrialSignals

from .cells import Download, cells_csv, download

FRAMES = 8  # of a strip
SIZE = (216, 264)  # of a frame [pixels], shown at half of it: sharp on a phone
QUALITY = 72  # of the pictures
CAMERA = Camera(azimuth=50.0, elevation=18.0, distance=4.6)
AFTER = 0.4  # [s] shown after the last moment that matters
POINTS = {"com": ("com_x", "com_y"), "cop": ("cop_x", "cop_y"),
          "capture_point": ("capture_x", "capture_y"),
          "angular_momentum": ("L_x", "L_y", "L_z")}  # fmt: skip


@dataclass(frozen=True)
class Exhibit:
    """A trial worth looking at.

    Attributes:
        record: how the controller fared.
        reason: why it is shown.
        baseline: the baseline's record of the same trial where it recovered, to compare.
        others: other controllers that recovered it.
    """

    record: Record
    reason: str
    baseline: Record | None
    others: tuple[str, ...]


@dataclass(frozen=True)
class Film:
    """A trial simulated again.

    Attributes:
        record: as recorded.
        signals: over time.
        frames: (time [s], picture as WebP).
        same: whether it ended exactly as recorded.
    """

    record: Record
    signals: TrialSignals
    frames: Sequence[tuple[float, bytes]]
    same: bool


def choose_exhibits(results: Results, baseline: str, order: Sequence[str]) -> list[Exhibit]:
    """One trial for each controller, in this order, if it lost any.

    Of a controller other than the baseline it is the smallest push that it lost and the baseline
    recovered; else, and of the baseline, the smallest push that it lost. Pushes are compared by
    their fraction of the limit. Without pushes, it is the first trial that was lost.
    """
    recovered: dict[tuple[str, ...], dict[str, Record]] = {}
    for record in results.records:
        if record.won:
            recovered.setdefault(record.met, {})[record.controller] = record
    exhibits = []
    for name in order:
        lost = smallest_lost(results, name)
        if not lost:
            continue
        shown = [r for r in lost if name != baseline and baseline in recovered.get(r.met, {})]
        record = (shown or lost)[0]
        winners = recovered.get(record.met, {})
        what = "The smallest push" if math.isfinite(record.fraction) else "The first trial"
        fell = record.fallen and record.judged_by_falls
        reason = f"{what} {f'in which {name} fell' if fell else f'that {name} did not recover'}"
        if shown:
            reason += f" and {baseline} did{' not' if fell else ''}"
        others = tuple(winner for winner in winners if winner != baseline)
        exhibits.append(Exhibit(record, reason, winners.get(baseline), others))
    return exhibits


def smallest_lost(results: Results, name: str) -> list[Record]:
    """The trials that a controller did not recover (of walks: in which it fell), the smallest push
    first, without its errors."""
    lost = [r for r in results.of(name) if not r.won and not r.error]
    return sorted(lost, key=_size)


def film_again(results: Results, record: Record, times: Sequence[float], draw: bool = True) -> Film:
    """Play a trial again; `times` [s] are those of the frames, if any are drawn.

    Raises:
        ConfigError: the controller or the robot is no longer what was evaluated.
        PoiseError: nothing can be drawn here.
    """
    signals, camera = TrialSignals(), _FrameTaker(times if draw else (), record.direction)

    def watch(env: BalanceEnv) -> None:
        signals(env)
        camera(env)

    with closing(camera):
        again = replay(results, record.trial, record.controller, watch=watch)
    return Film(record, signals, camera.frames, not again.differences)


def frame_times(record: Record) -> list[float]:
    """Return the times of frames, from the push to the fall, or to when it is over [s]."""
    start = record.start or 0.0
    end = record.fall_time if math.isfinite(record.fall_time) else start + 3.0
    return [float(t) for t in np.linspace(start, max(end, start + AFTER), FRAMES)]


def can_draw() -> str | None:
    """None if frames can be drawn here, else why not."""
    import mujoco

    from poise.envs.viewing.offscreen import OffScreen

    try:
        OffScreen(mujoco.MjModel.from_xml_string("<mujoco/>"), 16, 16).close()
    except PoiseError as error:
        return str(error)
    return None


class _FrameTaker:
    """Draws the frame at or just after each of the times, from beside the push."""

    def __init__(self, times: Sequence[float], direction: float):
        self.camera = beside(direction, CAMERA) if math.isfinite(direction) else CAMERA
        self.times = list(times)
        self.frames: list[tuple[float, bytes]] = []
        self._renderer: SceneRenderer | None = None

    def __call__(self, env: BalanceEnv) -> None:
        time = env.simulation.time
        if not self.times or time < self.times[0] - 1e-9:
            return
        while self.times and self.times[0] <= time + 1e-9:
            self.times.pop(0)
        if self._renderer is None:
            self._renderer = SceneRenderer(env.simulation, human=False, width=SIZE[0],
                                           height=SIZE[1], camera=self.camera)  # fmt: skip
        frame = self._renderer.render()
        assert frame is not None  # off-screen
        self.frames.append((time, compressed(frame)))

    def close(self) -> None:
        if self._renderer is not None:
            self._renderer.close()


def signals_csv(name: str, t: np.ndarray, columns: Mapping[str, np.ndarray]) -> Download:
    """Return all signals as CSV, to a hundredth of what the plot shows."""
    header, blocks = ["t"], [t[:, None]]
    for key, titles in POINTS.items():
        header += titles
        blocks.append(columns[key])
    header += ["support_x_low", "support_x_high", "support_y_low", "support_y_high", "torque"]
    blocks += [columns["support"].reshape(len(t), 4), columns["torque"][:, None]]
    lines = [[f"{value:.5g}" for value in line] for line in np.hstack(blocks)]
    return download(f"{name}.csv", cells_csv(header, lines))


def compressed(frame: np.ndarray) -> bytes:
    """Return a frame (h, w, 3) as WebP."""
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(frame).save(buffer, "WEBP", quality=QUALITY, method=6)
    return buffer.getvalue()


def _size(record: Record) -> tuple[float, int]:
    """Sorts by the fraction of the limit, then by number; trials without a push come last."""
    return (record.fraction if math.isfinite(record.fraction) else math.inf, record.trial)
