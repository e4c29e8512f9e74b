"""Videos of episodes, and strips of their frames."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from poise.configs.errors import ConfigError, PoiseError
from poise.envs.balance.base import BalanceEnv
from poise.envs.balance.mdp.termination import has_diverged
from poise.envs.physics.collapse import DURATION as FALLING
from poise.envs.physics.collapse import Collapse
from poise.envs.viewing.camera import Camera
from poise.envs.viewing.renderer import SceneRenderer

from .encoder import check_video, encoded
from .style import saved_figure

INK = (20, 20, 20)  # of names over pictures
SIZE, RATE = (640, 480), 25.0  # [pixels], [1/s]
WEBP_SIZE, WEBP_RATE = (320, 320), 12.5  # for pages, so small


def record(
    env: gymnasium.Env,
    act: Callable[[np.ndarray], np.ndarray],
    path: str | Path,
    reset_kwargs: dict[str, Any] | None = None,
    *,
    fps: float | None = None,
    slow_motion: float = 1.0,
    size: tuple[int, int] | None = None,
    camera: Camera | str | int | None = None,
) -> dict[str, Any]:
    """Play one episode and write it as an MP4 (H.264, yuv420p) that browsers play, or as a WebP.

    The file appears complete or not at all. A robot that falls is shown until it lies on the
    ground, with damped motors; that is no part of the episode. Every n-th policy step is drawn,
    with n such that the video has about `fps` frames a second; drawing takes most of the time. A
    WebP is for pages, and small by default.

    Args:
        env: one of Poise's environments, wrapped or not, in any render mode.
        act: the action for an observation.
        path: where to write, ending in .mp4 or .webp.
        reset_kwargs: `seed` and `options` of the reset.
        fps: frames a second that are wanted [1/s]; None: `RATE`, of a WebP `WEBP_RATE`.
        slow_motion: how much longer the video takes than the episode.
        size: width and height [pixels], even; None: `SIZE`, of a WebP `WEBP_SIZE`.
        camera: where it stands, or which one of the model it is, see `find_camera`.

    Returns:
        "path", "frames", "fps" (as written), "seconds" (of the episode), "fallen", "recovered"
        and "return" (the sum of rewards).

    Raises:
        ConfigError: the path, rate, slow motion or size is not valid.
        PoiseError: nothing can be drawn or encoded here, or the file cannot be written.
    """
    usual_size, usual_rate = usual(path)
    size, fps = size or usual_size, usual_rate if fps is None else fps
    _check(path, fps, slow_motion, size)
    with Episode(env, act, reset_kwargs, size, camera) as episode:
        frames, rate = _film([episode], Path(path), fps, slow_motion, lambda: episode.frame)
    return {
        "path": str(path),
        "frames": frames,
        "fps": rate,
        "seconds": episode.seconds,
        "fallen": episode.base.fallen,
        "recovered": bool(episode.info["is_success"]),
        "return": episode.total,
    }


def usual(path: str | Path) -> tuple[tuple[int, int], float]:
    """Return the default size and frame rate of a video."""
    small = Path(path).suffix.lower() == ".webp"
    return (WEBP_SIZE, WEBP_RATE) if small else (SIZE, RATE)


def record_together(
    episodes: Mapping[str, Episode],
    path: str | Path,
    *,
    fps: float = RATE,
    watch: Callable[[float], object] = float,
) -> int:
    """Film several episodes side by side, each under its name; returns the number of frames.

    They run at the same time, whatever their policy periods. One that has ended stays as it was
    then, until the last has ended; one that has fallen goes to the ground first.
    `watch` takes the time of each step [s].

    Raises:
        ConfigError: the path, rate or size is not valid, or sizes differ.
        PoiseError: the video cannot be encoded, or the file cannot be written.
    """
    own = list(episodes.values())
    if not own or len({each.size for each in own}) != 1:
        raise ConfigError("give one or more, of one size", field="episodes")
    _check(path, fps, 1.0, own[0].size)

    def frame() -> np.ndarray:
        return np.hstack([_labelled(name, each) for name, each in episodes.items()])

    return _film(own, Path(path), fps, 1.0, frame, watch)[0]


class Episode:
    """An episode to be filmed; use as a context, which frees what draws it.

    Args:
        env, act, reset_kwargs, size, camera: as of `record`.

    Attributes:
        frame: the picture (height, width, 3) uint8 that `draw` has made last.
        done: it has ended.
        over: there is nothing more to see: it has ended, and lies on the ground if it fell.
        seconds: that it has lasted [s].
        total: sum of rewards.
    """

    def __init__(
        self,
        env: gymnasium.Env,
        act: Callable[[np.ndarray], np.ndarray],
        reset_kwargs: dict[str, Any] | None = None,
        size: tuple[int, int] = SIZE,
        camera: Camera | str | int | None = None,
    ):
        base = env.unwrapped
        if not isinstance(base, BalanceEnv):
            name = type(base).__name__
            raise PoiseError(f"only Poise's environments can be recorded, not {name}")
        self.env, self.base, self.act, self.size = env, base, act, size
        self.reset_kwargs = reset_kwargs or {}
        self.renderer = SceneRenderer(base.simulation, human=False, width=size[0], height=size[1],
                                      camera=camera)  # fmt: skip

    def start(self) -> None:
        """Start over, with the first picture."""
        self.observation, self.info = self.env.reset(**self.reset_kwargs)
        self.total, self.done, self.over, self.seconds = 0.0, False, False, 0.0
        self.draw()

    def step(self) -> None:
        """Play one policy step; after a fall, one of the way to the ground."""
        if self.done:
            self._fall()
            return
        self.observation, reward, terminated, truncated, self.info = self.env.step(
            self.act(self.observation)
        )
        self.total, self.done = self.total + float(reward), terminated or truncated
        if self.done:
            self.seconds = self.base.simulation.time
            self.over = not self.base.fallen or has_diverged(self.base.simulation.views)
            self._collapse = Collapse(self.base.simulation)

    def _fall(self) -> None:
        if not self.over:
            self._collapse.step(self.base.substeps)
            self.over = self.base.simulation.time > self.seconds + FALLING

    def draw(self) -> None:
        """Bring the picture up to date."""
        frame = self.renderer.render()
        assert frame is not None  # the renderer is open and off-screen
        self.frame = frame

    def __enter__(self) -> Episode:
        return self

    def __exit__(self, *_: object) -> None:
        self.renderer.close()


def _film(
    episodes: Sequence[Episode], path: Path, fps: float, slow_motion: float,
    frame: Callable[[], np.ndarray], watch: Callable[[float], object] = float,
) -> tuple[int, float]:  # fmt: skip
    """Play all to their ends at the same time and write what `frame` gives of them side by side.

    Returns how many frames there are, and how many the video has a second.
    """
    periods = [each.base.config.policy_period for each in episodes]
    longest = max(periods)
    every = max(1, round(1.0 / (fps * longest * slow_motion)))  # its steps from frame to frame
    rate = 1.0 / (every * longest * slow_motion)
    width, height = episodes[0].size
    frames, step, taken = 1, 0, [0] * len(episodes)
    with encoded(path, (width * len(episodes), height), rate) as send:
        for each in episodes:
            each.start()
        send(frame())
        while not all(each.over for each in episodes):
            playing = [each for each in episodes if not each.over]
            step += 1
            watch(step * longest)
            for i, each in enumerate(episodes):
                while not each.over and taken[i] * periods[i] < step * longest - 1e-9:
                    each.step()
                    taken[i] += 1
            ended = all(each.over for each in episodes)
            if step % every == 0 or ended:
                for each in playing:
                    each.draw()
                send(frame())
                frames += 1
    return frames, rate


def _labelled(name: str, episode: Episode) -> np.ndarray:
    """Return the episode's picture with its name, and how it ended."""
    from PIL import Image, ImageDraw, ImageFont

    picture = Image.fromarray(episode.frame)
    end = ("fell" if episode.base.fallen else "recovered" if episode.info["is_success"]
           else "not quiet") if episode.done else ""  # fmt: skip
    width, height = episode.size
    font = ImageFont.load_default(max(10.0, height / 20.0))
    draw = ImageDraw.Draw(picture)
    draw.text((0.03 * width, 0.03 * height), name, fill=INK, font=font)
    draw.text((0.97 * width, 0.03 * height), end, fill=INK, font=font, anchor="ra")
    return np.asarray(picture)


def frame_strip(
    path: str | Path, frames: Sequence[np.ndarray], times: Sequence[float], columns: int = 6
) -> None:
    """Save frames (h, w, 3), labelled by their times [s], in rows of `columns` as one PNG.

    Raises:
        ConfigError: there are no frames, or not one time for each.
        PoiseError: the file cannot be written.
    """
    if not frames or len(times) != len(frames) or columns < 1:
        raise ConfigError(f"{len(frames)} frames with {len(times)} times in {columns} columns",
                          field="frames")  # fmt: skip
    columns = min(columns, len(frames))
    rows = -(-len(frames) // columns)
    height, width = frames[0].shape[:2]
    cell = 12.0 / max(columns, 4)  # [in]
    with saved_figure(path, cell * columns, cell * rows * height / width) as figure:
        figure.set_layout_engine("constrained", w_pad=0.02, h_pad=0.02, wspace=0.0, hspace=0.0)
        axes = figure.subplots(rows, columns, squeeze=False).ravel()
        for ax in axes:
            ax.set_axis_off()
        for ax, frame, t in zip(axes, frames, times, strict=False):
            ax.imshow(frame, aspect="auto")
            ax.text(0.04, 0.04, f"{t:.2f} s", transform=ax.transAxes, fontsize=12)


def _check(path: str | Path, fps: float, slow_motion: float, size: tuple[int, int]) -> None:
    check_video(path)
    for name, value in (("fps", fps), ("slow_motion", slow_motion)):
        if not (np.isfinite(value) and value > 0.0):
            raise ConfigError(f"must be positive, not {value}", field=name)
    if any(edge < 16 or edge % 2 for edge in size):
        raise ConfigError(f"must be two even numbers of at least 16, not {size}", field="size")
