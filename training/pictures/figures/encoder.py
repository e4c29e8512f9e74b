"""FFmpeg, fed frame by frame."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from poise.configs.errors import ConfigError, PoiseError

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


class Encoder:
    """FFmpeg, fed frame by frame; the file takes its name when the block ends well."""

    def __init__(self, path: Path, size: tuple[int, int], rate: float):
        self.path, self.size, self.rate = path, size, rate
        self.part = path.with_name(f".{path.stem}.{os.getpid()}.part{path.suffix.lower()}")

    def __enter__(self) -> Encoder:
        import imageio_ffmpeg

        self.writer = imageio_ffmpeg.write_frames(
            str(self.part), self.size, fps=self.rate, macro_block_size=2, quality=None,
            ffmpeg_log_level="error", **FORMS[self.path.suffix.lower()],
        )  # fmt: skip
        with self._reported():
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self.writer.send(None)
        return self

    def send(self, frame: np.ndarray) -> None:
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
