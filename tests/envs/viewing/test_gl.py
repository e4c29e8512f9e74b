"""The choice of an off-screen renderer, and what our modules leave alone."""

import ctypes.util
import os
import subprocess
import sys

import pytest

from poise.envs.viewing import gl


@pytest.fixture
def bare(monkeypatch):
    """Linux without a display, where nothing has been chosen and MuJoCo is not loaded."""
    for name in ("MUJOCO_GL", "DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.delitem(sys.modules, "mujoco", raising=False)

    def installed(*libraries):
        monkeypatch.setattr(gl.ctypes.util, "find_library", lambda n: n if n in libraries else None)

    installed("OSMesa", "EGL")
    monkeypatch.setenv("MUJOCO_GL", "")  # so that what a test sets is undone
    monkeypatch.setenv("MESA_SHADER_CACHE_DISABLE", "")
    return installed


@pytest.mark.parametrize(
    "libraries, backend", [(("OSMesa", "EGL"), "osmesa"), (("EGL",), "egl"), ((), None)]
)
def test_software_comes_first(bare, libraries, backend):
    """OSMesa where it is installed, else EGL, else nothing is set."""
    bare(*libraries)
    assert gl.choose_gl_backend() == backend
    assert os.environ["MUJOCO_GL"] == (backend or "")


def test_choice_of_the_user_stays(bare, monkeypatch):
    """A value of MUJOCO_GL is returned, not replaced."""
    monkeypatch.setenv("MUJOCO_GL", "egl")
    assert gl.choose_gl_backend() == "egl"


def test_no_thread_of_least_priority_is_started(bare, monkeypatch):
    """It would hold up the end of the process; a value of the user stays."""
    monkeypatch.delenv("MESA_SHADER_CACHE_DISABLE", raising=False)
    gl.choose_gl_backend()
    assert os.environ["MESA_SHADER_CACHE_DISABLE"] == "true"
    monkeypatch.setenv("MESA_SHADER_CACHE_DISABLE", "false")
    gl.choose_gl_backend()
    assert os.environ["MESA_SHADER_CACHE_DISABLE"] == "false"


@pytest.mark.parametrize("situation", ["display", "macOS", "too late"])
def test_nothing_is_set_where_it_would_not_help(bare, monkeypatch, situation):
    """With a display, on another system, or after MuJoCo has read the variable."""
    if situation == "display":
        monkeypatch.setenv("DISPLAY", ":0")
    elif situation == "macOS":
        monkeypatch.setattr(sys, "platform", "darwin")
    else:
        monkeypatch.setitem(sys.modules, "mujoco", os)
    assert not gl.choose_gl_backend()
    assert os.environ["MUJOCO_GL"] == ""


def test_imports_set_no_variable_and_choosing_loads_no_mujoco():
    """The module `gl` comes without MuJoCo; the modules that draw leave the environment alone."""
    code = (
        "import os, sys; import poise.envs.viewing.gl; assert 'mujoco' not in sys.modules;"
        "before = dict(os.environ); import poise.envs.viewing.renderer;"
        "import poise.training.pictures.figures.video;"
        "assert 'mujoco' in sys.modules; new = set(os.environ.items()) - set(before.items());"
        "assert not new, new"
    )
    environment = {name: value for name, value in os.environ.items() if name != "MUJOCO_GL"}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True)
    assert done.returncode == 0, done.stderr.decode()


@pytest.mark.skipif(ctypes.util.find_library("OSMesa") is None, reason="no OSMesa is installed")
def test_other_libraries_do_not_see_osmesa():
    """Nor the LLVM that comes with it: Triton, whose own has the same names, would not survive."""
    code = (
        "import ctypes, poise.envs, mujoco;"
        "everything = ctypes.CDLL(None);"
        "assert not hasattr(everything, 'OSMesaCreateContextExt'), 'shown';"
        "mujoco.Renderer(mujoco.MjModel.from_xml_string('<mujoco/>'), 16, 16).render()"
    )
    environment = {**os.environ, "MUJOCO_GL": "osmesa"}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True)
    assert done.returncode == 0, done.stderr.decode()


HIDDEN = """
import ctypes, ctypes.util
find, init = ctypes.util.find_library, ctypes.CDLL.__init__
ctypes.util.find_library = lambda name: None if "OSMesa" in name else find(name)
def loaded(self, name, *args, **kwargs):
    if name and "OSMesa" in str(name):
        raise OSError(f"{name}: cannot open shared object file")
    init(self, name, *args, **kwargs)
ctypes.CDLL.__init__ = loaded
"""


@pytest.mark.parametrize(
    "command",
    [["replay", ".", "--trial", "0", "--video", "a.mp4"], ["robot", "compact"]],
)
def test_software_that_is_asked_for_and_missing_is_one_line(tmp_path, command):
    """With the package's name, and no traceback, whatever draws or does not."""
    pytest.importorskip("OpenGL")
    (tmp_path / "sitecustomize.py").write_text(HIDDEN)
    (tmp_path / "summary.json").write_text("{}")
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, "-m", "poise.training.cli", *command], capture_output=True, text=True,
        env={**os.environ, "PYTHONPATH": path, "MUJOCO_GL": "osmesa"}, cwd=tmp_path,
    )  # fmt: skip
    assert "Traceback" not in done.stderr and done.returncode != 0
    assert "libosmesa6" in done.stderr and len(done.stderr.strip().splitlines()) == 1, done.stderr
