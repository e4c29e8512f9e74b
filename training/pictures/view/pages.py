"""The open pages: messages and files sent to them, and their cameras."""

import io
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import numpy as np
import viser
from PIL import Image

from poise.configs.errors import PoiseError
from poise.training.pictures.sessions.live import Play

from .stage import PHONE, ViewStage

CLOSE = 6.0  # [s] after which a message disappears
#: [s] for a browser to draw a picture: in software seconds, on a busy machine a minute
TIMEOUT = 180.0
Colour = Literal["red"] | None


class Pages:
    """Pages of a server; `stage()` is what they show.

    A page that is opened shows all robots, and again when its form changes, as panels are docked
    late, until the user has moved the camera.
    """

    def __init__(self, server: viser.ViserServer, stage: Callable[[], ViewStage]):
        self._server, self._stage = server, stage
        self._phones: dict[int, bool] = {}  # page → whether its controls are below
        self._last: tuple[float, str, Colour] = (-np.inf, "", None)  # last message: when, what
        server.on_client_connect(self._connected)

    def say(self, text: str, colour: Colour = None) -> None:
        """Tell all of them, and one that opens a moment later: a link may be what opens it."""
        self._last = time.monotonic(), text, colour
        for client in self._server.get_clients().values():
            _notify(client, text, colour)

    def point_cameras(self) -> None:
        """Let all of them see all robots."""
        for page, client in self._server.get_clients().items():
            self._stage().point_camera(client, self._phones.get(page, False))

    def _connected(self, client: viser.ClientHandle) -> None:
        self._phones[client.client_id] = phone = client.camera.image_width < PHONE
        form, eye = client.camera.aspect, self._stage().point_camera(client, phone)
        said, text, colour = self._last
        if time.monotonic() - said < CLOSE:
            _notify(client, text, colour)

        @client.camera.on_update
        def _(camera: viser.CameraHandle) -> None:
            nonlocal form, eye
            changed = abs(camera.aspect - form) > 1e-3
            if changed and np.allclose(camera.position, eye, atol=1e-2):
                form, eye = camera.aspect, self._stage().point_camera(client, phone)


def _notify(client: viser.ClientHandle, text: str, colour: Colour) -> None:
    client.add_notification("Poise", text, auto_close_seconds=CLOSE, color=colour)


def send_picture(server: viser.ViserServer, client: int, background: tuple[int, int, int]) -> None:
    """Send the client a PNG of its own view; waits for the browser, so call it in its thread."""
    viewer = server.get_clients().get(client)
    if viewer is None:
        return
    size = viewer.camera.image_height, viewer.camera.image_width
    drawn = viewer.get_render(*size, transport_format="png", timeout=TIMEOUT)
    viewer.send_file_download("poise.png", png(drawn, background), save_immediately=True)


def png(drawn: np.ndarray, background: tuple[int, int, int]) -> bytes:
    """Return a picture (h, w, 4) uint8 on a background, as the bytes of a file."""
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
        raise PoiseError("the page is no longer open")
    with tempfile.TemporaryDirectory(prefix="poise-view-") as folder:
        for k, name in enumerate(play.names):
            path = Path(folder) / "poise.mp4"
            play.film(name, path)
            number = f"-{k + 1}" if len(play.names) > 1 else ""
            film = path.read_bytes()
            viewer.send_file_download(f"poise{number}.mp4", film, save_immediately=True)
