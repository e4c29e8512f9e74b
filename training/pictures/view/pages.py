"""The open pages: what they are told, and where their cameras are."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Literal

import numpy as np
import viser

from .stage import PHONE, Stage

CLOSE = 6.0  # [s] after which what is told goes away
Colour = Literal["red"] | None


class Pages:
    """Pages of a server; `stage()` is what they show.

    A page that is opened shows all robots, and again when its form changes, as panels are docked
    late, until the user has moved the camera.
    """

    def __init__(self, server: viser.ViserServer, stage: Callable[[], Stage]):
        self._server, self._stage = server, stage
        self._phones: dict[int, bool] = {}  # page → whether its controls are below
        self._last: tuple[float, str, Colour] = (-np.inf, "", None)  # that was told: when, what
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
        told, text, colour = self._last
        if time.monotonic() - told < CLOSE:
            _notify(client, text, colour)

        @client.camera.on_update
        def _(camera: viser.CameraHandle) -> None:
            nonlocal form, eye
            changed = abs(camera.aspect - form) > 1e-3
            if changed and np.allclose(camera.position, eye, atol=1e-2):
                form, eye = camera.aspect, self._stage().point_camera(client, phone)


def _notify(client: viser.ClientHandle, text: str, colour: Colour) -> None:
    client.add_notification("Poise", text, auto_close_seconds=CLOSE, color=colour)
