"""One trial of a result, filmed: with one controller, or with several side by side."""

from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from pathlib import Path

from poise.baselines.allowance import allowing
from poise.envs.viewing.camera import Camera, beside
from poise.training.benchmarking.trials.trial import Trial
from poise.training.pictures.figures.video import SIZE, Episode, record_together, usual
from poise.training.running.files import SETTINGS

from .player import player
from .read import Results, load_results

NARROW = (480, 480)  # [pixels] of one of several


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
        fps: frames a second that are wanted [1/s]; None: as of `record`.
        size: width and height of each picture [pixels]; None: as of `record`, but `NARROW` of
            several that are no WebP.
        allow: controllers from outside (``module:Class``) that may run.

    Raises:
        ConfigError: as `replay`, and for a path or size that is not valid.
        PoiseError: nothing can be drawn or encoded here, or the file cannot be written.
    """
    where = folder.folder if isinstance(folder, Results) else Path(folder)
    usual_size, usual_rate = usual(path)
    if len(controllers) > 1 and usual_size == SIZE:
        usual_size = NARROW
    size, fps = size or usual_size, fps or usual_rate
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
