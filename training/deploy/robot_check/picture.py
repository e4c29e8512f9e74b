"""A robot in its standing posture, from three sides with its CoM and support, and its soles."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

from poise.envs.physics.simulation import Simulation
from poise.envs.robots.robot import Robot
from poise.envs.viewing.camera import Camera
from poise.envs.viewing.renderer import SceneRenderer
from poise.training.pictures.figures.palette import BLUE, GREEN, INK, PALE
from poise.training.pictures.figures.style import legend_below, saved_figure

SIZE = (420, 620)  # of a view [pixels]
VIEWS = {"in front": (0.0, 6.0), "left": (90.0, 6.0), "obliquely": (40.0, 30.0)}  # [deg]


def write_picture(robot: Robot, path: str | Path) -> None:
    """Write a PNG file.

    Raises:
        PoiseError: there is no OpenGL to draw with, or the file cannot be written.
    """
    simulation = Simulation(robot)
    views = {name: _view(simulation, *angles) for name, angles in VIEWS.items()}
    with saved_figure(path, 14.0, 5.0) as figure:
        axes = figure.subplots(1, 4, width_ratios=(1.0, 1.0, 1.0, 1.3))
        for ax, (name, frame) in zip(axes, views.items(), strict=False):
            ax.imshow(frame)
            ax.set_axis_off()
            ax.set_title(f"{robot.name}, {name}" if ax is axes[0] else name)
        _soles(axes[3], simulation)
        legend_below(figure)


def _view(simulation: Simulation, azimuth: float, elevation: float) -> np.ndarray:
    camera = Camera(azimuth=azimuth, elevation=elevation)
    renderer = SceneRenderer(simulation, human=False, width=SIZE[0], height=SIZE[1], camera=camera)
    try:
        frame = renderer.render()
    finally:
        renderer.close()
    assert frame is not None, "off-screen"
    return frame


def _soles(ax: Axes, simulation: Simulation) -> None:
    """Forward is up, left is left."""
    state = simulation.state
    for sole, point, turn in zip(
        simulation.robot.soles, state.sole_points, state.sole_axes, strict=True
    ):
        corners = point[:2] + sole.polygon @ turn[:2, :2].T
        ax.add_patch(Polygon(_plan(corners), facecolor=PALE, edgecolor=INK))
        x, y = _plan(point[None, :2])[0]
        ax.annotate(sole.name, (x, y), ha="center", va="center")
    support = _plan(np.array(state.support_polygon))
    ax.add_patch(Polygon(support, fill=False, edgecolor=GREEN, label="support polygon"))
    ax.plot(*_plan(state.com[None, :2]).T, "o", color=BLUE, label="CoM")
    ax.autoscale_view()
    ax.set_aspect("equal")
    ax.set_title("soles")
    ax.set_xlabel("to the right [mm]")
    ax.set_ylabel("ahead [mm]")


def _plan(points: np.ndarray) -> np.ndarray:
    """Ground points (k, 2) [m] as they lie in the picture [mm]."""
    return 1000.0 * np.column_stack([-points[:, 1], points[:, 0]])
