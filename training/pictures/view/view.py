"""`poise view`: what is named is checked, then loaded, then shown until the user ends it."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from poise.baselines.allowance import allows, listed
from poise.configs.errors import ConfigError
from poise.configs.problems import out_of_range
from poise.envs.sensing.realism import IDEAL
from poise.training.benchmarking.trials.names import check_names
from poise.training.pictures.sessions.live import Play
from poise.training.pictures.sessions.loading import load_live
from poise.training.pictures.sessions.recorded import recorded_trial
from poise.training.pictures.sessions.spec import MOST, STANDING, SessionSpec, Spec, TrialSpec

from .origins import Visits
from .server import check_installed, check_port, greeting, serving, until_ctrl_c

DEFAULT = "feedback-step"


@allows("controllers")
def view(
    controllers: Sequence[str] = (),
    *,
    robot: str = "humanoid",
    motion: str = STANDING,
    host: str = "127.0.0.1",
    port: int = 8080,
    seed: int = 0,
    pushes: Sequence[str] = (),
    commands: Sequence[str] = (),
    realism: str = IDEAL,
    native: bool = False,
    seconds: float | None = None,
    dark: bool = False,
    allow: str | Iterable[str] = (),
) -> float:
    """Show controllers side by side, which the user pushes; returns the real-time factor reached.

    Args:
        controllers: up to three names as `load_agent` takes them; none: `DEFAULT`.
        robot: a packaged robot or a path to its description.
        motion: that is performed: a packaged one, a .yaml, or a .npz of `poise motion import`.
        host, port: where the page is served; port 0 is any that is free.
        seed: of the start.
        pushes: scheduled ones, each a YAML mapping as `parse_pushes` takes it.
        commands: of controllers that walk, each a YAML mapping as `parse_commands` takes it.
        realism: a packaged realism level or a path to one.
        native: MuJoCo's own window instead of a page, of one controller.
        seconds: of the wall clock after which it ends; None: when the process is stopped.
        dark: whether the page is dark.
        allow: external controllers that may run though only a file names them.

    Raises:
        ConfigError: anything named does not exist or is not valid; nothing has been loaded then.
        PoiseError: viser is not installed, or there is no display.
    """
    spec = SessionSpec(tuple(controllers) or (DEFAULT,), robot, motion, seed, tuple(pushes),
                       tuple(commands), realism, tuple(listed(allow)))  # fmt: skip
    _check(spec, seconds, native)
    if not native:
        check_port(host, port)
        check_installed()
    live = load_live(spec, print)
    if native:
        from .native import run_native

        return run_native(live, seconds)
    return _serve(live, _load_session, host, port, seconds, dark)


def view_trial(
    folder: str | Path,
    trial: int,
    controllers: Sequence[str] = (),
    *,
    host: str = "127.0.0.1",
    port: int = 8080,
    seconds: float | None = None,
    dark: bool = False,
    allow: str | Iterable[str] = (),
) -> float:
    """Show a trial of a result, with a timeline; returns the real-time factor reached.

    Args:
        folder: written by `evaluate` or `benchmark`.
        trial: its number in trials.csv.
        controllers: up to three of those that took part; none: the last one.
        host, port, seconds, dark, allow: as of `view`.

    Raises:
        ConfigError, PoiseError: as `view` and `replay`.
    """
    _check_seconds(seconds)
    check_port(host, port)
    check_installed()

    def load(spec: Spec) -> Play:
        assert isinstance(spec, TrialSpec)
        play, lines = recorded_trial(Path(folder), spec.trial, spec.controllers, allow)
        for line in lines:
            print(line)
        return play

    play = load(TrialSpec(str(folder), trial, tuple(controllers)))
    return _serve(play, load, host, port, seconds, dark)


def _check(spec: SessionSpec, seconds: float | None, native: bool) -> None:
    """Raises ConfigError for what is wrong with the names, before anything is compiled."""
    count = len(spec.controllers)
    if count > (1 if native else MOST):
        most = "one controller is shown by --native" if native else f"at most {MOST} side by side"
        raise ConfigError(f"{most}, not {count}", field="controllers")
    _check_seconds(seconds)
    check_names(spec.controllers, robot=spec.robot, motion=spec.motion)


def _check_seconds(seconds: float | None) -> None:
    if seconds is not None and not seconds > 0.0:
        raise out_of_range(seconds, field="seconds", above=0)


def _load_session(spec: Spec) -> Play:
    assert isinstance(spec, SessionSpec)
    return load_live(spec)


def _serve(
    play: Play, load: Callable[[Spec], Play], host: str, port: int,
    seconds: float | None, dark: bool,
) -> float:  # fmt: skip
    from .browser import BrowserView

    visits = Visits()
    with serving(host, port, visits) as server:
        browser = BrowserView(server, play, load, dark)
        visits.opened = browser.visited
        link = play.spec.link if isinstance(play.spec, TrialSpec) else ""
        for line in greeting(host, server.get_port(), link):
            print(line)
        with until_ctrl_c():
            if seconds is None:
                print("Ctrl-C ends it")
            browser.run(seconds)
        print(f"{browser.pace.total:.3f} × real time over {browser.pace.wanted:.1f} s")
        return browser.pace.total
