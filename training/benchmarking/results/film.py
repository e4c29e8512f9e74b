"""One trial of a result, filmed: with one controller, or with several side by side."""

from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from pathlib import Path

from poise.baselines.allowance import allowing
from poise.envs.viewing.camera import Camera, beside
from poise.training.benchmarking.trials.trial import Trial
from poise.training.pictures.figures.video import Episode, record_together
from poise.training.running.files import SETTINGS

from .player import player
from .read import Results, load_results

SIZE = (640, 480)  # [pixels] of one controller alone
NARROW = (480, 480)  # of one of several
WEBP_SIZE, WEBP_RATE = (320, 320), 12.5  # [1/s]; for pages, so small


def film(
    folder: str | Path | Results,
    trial: int,
    controllers: Sequence[str],
    path: str | Path,
    *,
    fps: float | None = None,
    size: tuple[int, int] | None = None,
    allow: str | Iterable[str] = (),
) -> None:
    """Play a trial of a result again with some controllers and film them side by side.

    The camera stands beside the first push (`beside`).

    Args:
        folder: written by `evaluate` or `benchmark`, or what `load_results` has read there.
        trial: its number in trials.csv; all of `controllers` have played it.
        controllers: names, from left to right.
        path: of the video, ending in .mp4 or .webp.
        fps: frames a second that are wanted [1/s]; None: 25, of a WebP `WEBP_RATE`.
        size: width and height of each picture [pixels]; None: `SIZE`, `NARROW` of several, of a
            WebP `WEBP_SIZE`.
        allow: controllers from outside (``module:Class``) that may run.

    Raises:
        ConfigError: as `replay`, and for a path or size that is not valid.
        PoiseError: nothing can be drawn or encoded here, or the file cannot be written.
    """
    where = folder.folder if isinstance(folder, Results) else Path(folder)
    small = Path(path).suffix.lower() == ".webp"
    size = size or (WEBP_SIZE if small else SIZE if len(controllers) == 1 else NARROW)
    fps = fps or (WEBP_RATE if small else 25.0)
    with allowing(allow, source=where / SETTINGS), ExitStack() as stack:
        results = folder if isinstance(folder, Results) else load_results(where)
        episodes = {}
        for name in controllers:
            again = results.trial(results.record(name, trial))
            episode = _episode(results, name, again, size)
            episodes[name] = stack.enter_context(episode)
        record_together(episodes, path, fps=fps)


def _episode(results: Results, name: str, trial: Trial, size: tuple[int, int]) -> Episode:
    agent = player(results, name, trial)
    if agent.begin is not None:
        agent.begin()
    camera = Camera() if trial.push is None else beside(trial.push.direction)
    start = {"seed": trial.seed, "options": trial.options}
    return Episode(agent.env, agent.act, start, size, camera)
