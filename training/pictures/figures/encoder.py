"""FFmpeg, fed frame by frame."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from poise.configs.errors import ConfigError, WriteError

CRF = 20  # quality of H.264, lower is better: 18 is visually lossless
FORMS: dict[str, dict[str, Any]] = {
    ".mp4": {"codec": "libx264", "pix_fmt_out": "yuv420p",
             "output_params": ["-crf", str(CRF), "-movflags", "+faststart"]},
    ".webp": {"codec": "libwebp_anim", "pix_fmt_out": "yuv420p",
              "output_params": ["-quality", "70", "-loop", "0"]},
}  # fmt: skip


def check_video(path: str | Path) -> None:
    """Raise ConfigError for a path that is no video's."""
    if Path(path).suffix.lower() not in FORMS:
        raise ConfigError(f"the name of a video must end in {' or '.join(FORMS)}", source=path)


@contextmanager
def encoded(
    path: Path, size: tuple[int, int], rate: float
) -> Iterator[Callable[[np.ndarray], None]]:
    """Run FFmpeg: yield a sink for frames; the file gets its name when the block succeeds.

    Raises WriteError if the file cannot be written.
    """
    import imageio_ffmpeg

    part = path.with_name(f".{path.stem}.{os.getpid()}.part{path.suffix.lower()}")
    writer = imageio_ffmpeg.write_frames(
        str(part), size, fps=rate, macro_block_size=2, quality=None, ffmpeg_log_level="error",
        **FORMS[path.suffix.lower()],
    )  # fmt: skip

    def send(frame: np.ndarray) -> None:
        with _reported(path):
            writer.send(np.ascontiguousarray(frame))

    with _reported(path):
        path.parent.mkdir(parents=True, exist_ok=True)
    try:
        with _reported(path):
            writer.send(None)
        yield send
        with _reported(path):
            writer.close()
            os.replace(part, path)
    finally:
        writer.close()
        part.unlink(missing_ok=True)


@contextmanager
def _reported(path: Path) -> Iterator[None]:
    """Turn FFmpeg's errors into WriteError."""
    try:
        yield
    except (OSError, RuntimeError) as error:
        reason = getattr(error, "strerror", None) or str(error).strip().splitlines()[0]
        raise WriteError(path, reason) from error
