"""Videos of episodes, and strips of their frames."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from poise.configs.errors import ConfigError, PoiseError
from poise.envs.balance.base import BalanceEnv
from poise.envs.viewing.camera import Camera
from poise.envs.viewing.renderer import SceneRenderer

from .style import saved_figure

CRF = 20  # quality of H.264, lower is better: 18 is visually lossless


def record(
    env: gymnasium.Env,
    act: Callable[[np.ndarray], np.ndarray],
    path: str | Path,
    reset_kwargs: dict[str, Any] | None = None,
    *,
    fps: float = 25.0,
    slow_motion: float = 1.0,
    size: tuple[int, int] = (640, 480),
    camera: Camera | str | int | None = None,
) -> dict[str, Any]:
    """Play one episode and write it as an MP4 (H.264, yuv420p) that browsers play.

    The file appears complete or not at all. Every n-th policy step is drawn, with n such that the
    video has about `fps` frames a second; drawing takes most of the time.

    Args:
        env: one of Poise's environments, wrapped or not, in any render mode.
        act: the action for an observation.
        path: where to write, ending in .mp4.
        reset_kwargs: `seed` and `options` of the reset.
        fps: frames a second that are wanted [1/s].
        slow_motion: how much longer the video takes than the episode.
        size: width and height [pixels], even.
        camera: where it stands, or which one of the model it is, see `find_camera`.

    Returns:
        "path", "frames", "fps" (as written), "seconds" (of the episode), "fallen", "recovered"
        and "return" (the sum of rewards).

    Raises:
        ConfigError: the path, rate, slow motion or size is not valid.
        PoiseError: nothing can be drawn or encoded here, or the file cannot be written.
    """
    base = env.unwrapped
    if not isinstance(base, BalanceEnv):
        raise PoiseError(f"only Poise's environments can be recorded, not {type(base).__name__}")
    _check(path, fps, slow_motion, size)
    period = base.config.policy_period * slow_motion
    every = max(1, round(1.0 / (fps * period)))
    rate = 1.0 / (every * period)
    renderer = SceneRenderer(base.simulation, human=False, width=size[0], height=size[1],
                             camera=camera)  # fmt: skip
    total, frames, step, done = 0.0, 1, 0, False
    try:
        with _Encoder(Path(path), size, rate) as video:
            observation, info = env.reset(**(reset_kwargs or {}))
            video.send(renderer.render())
            while not done:
                observation, reward, terminated, truncated, info = env.step(act(observation))
                total, step, done = total + float(reward), step + 1, terminated or truncated
                if step % every == 0 or done:
                    video.send(renderer.render())
                    frames += 1
    finally:
        renderer.close()
    return {
        "path": str(path),
        "frames": frames,
        "fps": rate,
        "seconds": base.simulation.time,
        "fallen": base.fallen,
        "recovered": bool(info["is_success"]),
        "return": total,
    }


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


class _Encoder:
    """FFmpeg, fed frame by frame; the file takes its name when the block ends well."""

    def __init__(self, path: Path, size: tuple[int, int], rate: float):
        self.path, self.size, self.rate = path, size, rate
        self.part = path.with_name(f".{path.stem}.{os.getpid()}.part.mp4")

    def __enter__(self) -> _Encoder:
        import imageio_ffmpeg

        self.writer = imageio_ffmpeg.write_frames(
            str(self.part), self.size, fps=self.rate, codec="libx264", pix_fmt_out="yuv420p",
            macro_block_size=2, quality=None, ffmpeg_log_level="error",
            output_params=["-crf", str(CRF), "-movflags", "+faststart"],
        )  # fmt: skip
        with self._reported():
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self.writer.send(None)
        return self

    def send(self, frame: np.ndarray | None) -> None:
        assert frame is not None  # the renderer is open and off-screen
        with self._reported():
            self.writer.send(np.ascontiguousarray(frame))

    def __exit__(self, failure: type | None, *_: object) -> None:
        try:
            with self._reported():
                self.writer.close()
                if failure is None:
                    os.replace(self.part, self.path)
        finally:
            self.part.unlink(missing_ok=True)

    @contextmanager
    def _reported(self) -> Iterator[None]:
        """FFmpeg's troubles as an error of ours."""
        try:
            yield
        except (OSError, RuntimeError) as error:
            reason = getattr(error, "strerror", None) or str(error).strip().splitlines()[0]
            raise PoiseError(f"{self.path}: the video cannot be written ({reason})") from error


def _check(path: str | Path, fps: float, slow_motion: float, size: tuple[int, int]) -> None:
    if Path(path).suffix.lower() != ".mp4":
        raise ConfigError("the name of a video must end in .mp4", source=path)
    for name, value in (("fps", fps), ("slow_motion", slow_motion)):
        if not (np.isfinite(value) and value > 0.0):
            raise ConfigError(f"must be positive, not {value}", field=name)
    if any(edge < 16 or edge % 2 for edge in size):
        raise ConfigError(f"must be two even numbers of at least 16, not {size}", field="size")
