"""Environments with Gymnasium's rendering interface."""

from collections.abc import Mapping

import gymnasium
import mujoco
import numpy as np

from poise.configs.errors import ConfigError, PoiseError, shown
from poise.configs.numbers import whole_number
from poise.envs.compiled.copies import Copyable
from poise.envs.physics.simulation import Simulation

from .camera import Camera, find_camera
from .renderer import SceneRenderer


class RenderedEnv(Copyable, gymnasium.Env):
    """The base of environments whose `simulation` can be drawn.

    Attributes:
        width: of a frame [pixels].
        height: of a frame [pixels].
        camera: the one that looks on, see `find_camera`.
    """

    metadata = {"render_modes": ["human", "rgb_array"], "render_fps": 50}  # noqa: RUF012
    simulation: Simulation

    def _set_up_rendering(
        self,
        model: mujoco.MjModel,
        render_mode: str | None,
        width: int,
        height: int,
        camera: Camera | Mapping[str, object] | str | int | None,
    ) -> None:
        """Raises ConfigError for an unknown mode or camera, and for sizes that are none."""
        modes = self.metadata["render_modes"]
        if render_mode is not None and not (isinstance(render_mode, str) and render_mode in modes):
            raise ConfigError(
                f"unknown render mode {shown(render_mode)}",
                field="render_mode",
                choices=tuple(modes),
            )
        self.render_mode = render_mode
        self.width = whole_number(width, 1, "width", "environment")
        self.height = whole_number(height, 1, "height", "environment")
        self.camera = find_camera(camera, model)
        self._renderer: SceneRenderer | None = None  # made when something is drawn

    def __getstate__(self) -> dict[str, object]:
        if self._renderer is not None and self._renderer.viewer is not None:
            raise PoiseError("an environment whose window is open cannot be copied: close() first")
        return {**super().__getstate__(), "_renderer": None}  # the copy draws with one of its own

    def render(self) -> np.ndarray | None:
        """A frame (height, width, 3) for "rgb_array"; shows it for "human"."""
        if self.render_mode is None:
            return None
        if self._renderer is None:
            self._renderer = SceneRenderer(
                self.simulation, self.render_mode == "human", self.width, self.height, self.camera
            )
        return self._renderer.render()

    def close(self) -> None:
        """Free what rendering holds."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None
