"""Settings shared by all tests: one thread each unless asked for more, an off-screen renderer."""

from __future__ import annotations

import ctypes.util
import functools
import gc
import os
import sys
from pathlib import Path

import pytest

# Set before any test imports NumPy, torch, MuJoCo or Matplotlib.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")  # small matrices lose time to threads
os.environ.setdefault("MPLBACKEND", "Agg")
# Tests start some hundred processes: none of them is to compile all modules again.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False
if sys.platform == "linux":
    off_screen = "osmesa" if ctypes.util.find_library("OSMesa") else "egl"
    os.environ.setdefault("MUJOCO_GL", off_screen)

gc.disable()  # until all is collected, or what stays would be searched for garbage again and again

import poise.envs  # noqa: E402, F401 - before any test imports MuJoCo: it sees to OSMesa


@functools.cache
def _rendering_problem() -> str | None:
    """Why MuJoCo cannot draw off-screen here, or None if it can."""
    import mujoco

    try:
        with mujoco.Renderer(mujoco.MjModel.from_xml_string("<mujoco/>"), 16, 16) as renderer:
            renderer.render()
    except Exception as error:  # every GL back end fails in its own way
        back_end = os.environ.get("MUJOCO_GL", "default")
        return f"MUJOCO_GL={back_end} cannot draw (Debian: install libosmesa6): {error!r}"
    return None


@pytest.fixture(scope="session")
def can_render() -> None:
    """Ask for this fixture in a test that draws: where no GL back end works, it is skipped."""
    problem = _rendering_problem()
    if problem:
        pytest.skip(problem)


@pytest.fixture
def few_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    """Videos of which nobody says the rate have five frames a second, and strips three frames:
    drawing takes its time.
    """
    monkeypatch.setattr("poise.training.pictures.figures.video.RATE", 5.0)
    monkeypatch.setattr("poise.training.pictures.report.worst_trials.FRAMES", 3)


HERE = Path(__file__).parent


def pytest_sessionstart(session):
    """Compile the kernels in processes of their own, so that this one and its children agree."""
    from poise.baselines.warmup import FURTHER, prepare

    prepare(*FURTHER)  # once, and not in each of xdist's processes


def pytest_collection_modifyitems(items):
    """Tests of what is above, which take longest, come first: the last ones, at which one process
    waits for another, are short.
    """
    items.sort(key=lambda item: HERE / "training" not in item.path.parents)


def pytest_collection_finish(session):
    """Tests have the collector of garbage as anybody has."""
    gc.enable()
