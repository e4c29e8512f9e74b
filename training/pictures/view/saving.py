"""What is seen, as files that the browser of whoever asked downloads."""

from __future__ import annotations

import io
import tempfile
from pathlib import Path

import numpy as np
import viser
from PIL import Image

from poise.configs.errors import PoiseError
from poise.training.pictures.sessions.live import Play

#: [s] for a browser to draw a picture: in software seconds, on a busy machine a minute
TIMEOUT = 180.0


def send_picture(server: viser.ViserServer, client: int, background: tuple[int, int, int]) -> None:
    """Send the client a PNG of its own view; waits for the browser, so call it in its thread."""
    viewer = server.get_clients().get(client)
    if viewer is None:
        return
    size = viewer.camera.image_height, viewer.camera.image_width
    drawn = viewer.get_render(*size, transport_format="png", timeout=TIMEOUT)
    viewer.send_file_download("poise.png", png(drawn, background), save_immediately=True)


def png(drawn: np.ndarray, background: tuple[int, int, int]) -> bytes:
    """A picture (h, w, 4) uint8 on a background, as the bytes of a file."""
    picture = Image.fromarray(np.ascontiguousarray(drawn), "RGBA")
    whole = Image.new("RGBA", picture.size, (*background, 255))
    whole.alpha_composite(picture)
    file = io.BytesIO()
    whole.convert("RGB").save(file, format="PNG")
    return file.getvalue()


def send_films(server: viser.ViserServer, client: int, play: Play) -> None:
    """Send the client an MP4 of each controller, from the start to now.

    Raises PoiseError: nothing can be drawn or encoded here.
    """
    viewer = server.get_clients().get(client)
    if viewer is None:
        raise PoiseError("nobody looks on any more")
    with tempfile.TemporaryDirectory(prefix="poise-view-") as folder:
        for k, name in enumerate(play.names):
            path = Path(folder) / "poise.mp4"
            play.film(name, path)
            number = f"-{k + 1}" if len(play.names) > 1 else ""
            film = path.read_bytes()
            viewer.send_file_download(f"poise{number}.mp4", film, save_immediately=True)
