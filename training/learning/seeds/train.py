"""One training run for each seed, spread over processes, and what they reached taken together."""

import json
import time
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.console import Console

from poise.baselines.allowance import allows
from poise.configs.errors import ConfigError, PoiseError
from poise.configs.files import write_atomic
from poise.configs.outputs import check_out_folder
from poise.configs.problems import out_of_range
from poise.configs.reading import whole_path
from poise.configs.schema import to_yaml
from poise.training.benchmarking.statistics.rates import seed_figures
from poise.training.learning.config import TrainConfig
from poise.training.learning.curriculum import curriculum_levels
from poise.training.learning.policy_files import CONFIG, LAST, find_checkpoint
from poise.training.learning.train import check_pushes, checkpoint_of, train
from poise.training.running.executor import Executor, check_backend
from poise.training.running.folder_lock import FolderLock, check_resume
from poise.training.running.provenance import circumstances
from poise.training.running.stopping import keeps

from .progress import SeedProgress, SeedRun, print_seeds
from .records import SEEDS, SeedEntry, SeedSummary, evaluations, read_seeds


@allows()
def train_seeds(
    config: TrainConfig,
    seeds: Sequence[int],
    out: str | Path,
    *,
    resume: bool = False,
    workers: int | None = None,
    backend: str = "local",
    console: Console | None = None,
    allow: str | Iterable[str] = (),
) -> SeedSummary:
    """Train one run per seed into `out`/seed-SEED; returns what seeds.json holds.

    Every run has the bits of `train` with its seed alone, whatever `workers` and `backend`. What a
    run raises ends that run alone. Finished runs are not trained again.

    Args:
        config: of all runs, but for the seed; each has one thread.
        seeds: all different; with `resume` other seeds found in `out` are trained too.
        out: folder of the runs, of their configuration and of seeds.json. All processes write
            there: on a cluster it is one that every machine sees.
        resume: go on with the runs that `out` holds.
        workers: number of runs at a time; None for all cores.
        backend: local, joblib or ray, as of `poise benchmark`.
        console: where progress and the table are printed; None: nowhere.
        allow: as of `train`.

    Raises:
        ConfigError: as `train`, before any run starts and anything is written.
        PoiseError: a run has failed, after the others are done; or a process has died.
    """
    console, started = console or Console(quiet=True), time.perf_counter()
    out = whole_path(out, field="out")
    check_out_folder(out)
    check_backend(backend)
    if workers is not None and workers < 1:
        raise out_of_range(workers, field="workers", least=1)
    given, seeds = seeds, _all_seeds(seeds, out, resume)
    runs = [SeedRun(replace(config, seed=seed, threads=1), out / f"seed-{seed}") for seed in seeds]
    for run in runs:
        if find_checkpoint(run.folder / LAST) is not None:
            checkpoint_of(run.config, run.folder, resume=True)  # one of another configuration
    missing = [run for run in runs if not run.entry()["finished"]]
    curriculum_levels(config)
    env = config.make_env()  # compiles all that the runs need, once
    check_pushes(config, env)
    env.close()
    keeps(out / SEEDS, f"what is trained is kept in {out}; go on with --resume")
    with FolderLock(out):
        _all_seeds(given, out, resume)  # another process may have begun since
        return _train(config, runs, missing, out, Executor(backend, workers), console, started)


def _train(
    config: TrainConfig,
    runs: Sequence[SeedRun],
    missing: Sequence[SeedRun],
    out: Path,
    executor: Executor,
    console: Console,
    started: float,
) -> SeedSummary:
    """Train what is missing; writes seeds.json at the start, and whole at the end."""
    seeds = [run.config.seed for run in runs]
    write_atomic(out / CONFIG, to_yaml(replace(config, seed=seeds[0], threads=1)))
    write_atomic(out / SEEDS, json.dumps({"runs": [run.entry() for run in runs]}, indent=1) + "\n")
    failed: list[str] = []
    with SeedProgress(runs, console), executor:
        for run, error in executor.each(train_run, missing):
            if error is None and not run.entry()["finished"]:
                error = f"{run.folder} is not finished here: do all machines see it?"
            if error is None:
                console.print(_line(run.entry()), markup=False, highlight=False)
            else:
                failed.append(f"seed {run.config.seed}: {error}")
    if failed:
        raise PoiseError(f"{'; '.join(failed)}; what is finished is kept, and --resume goes on")
    entries = [run.entry() for run in runs]
    rates = [[evaluations(entry)[1]["recovered"]] for entry in entries]
    summary: SeedSummary = {
        "runs": entries,
        "recovered": seed_figures(np.array(rates), seeds),
        **circumstances(started, executor.workers, executor.backend),
    }
    write_atomic(out / SEEDS, json.dumps(summary, indent=1) + "\n")
    print_seeds(summary, console)
    return summary


def train_run(run: SeedRun) -> str | None:
    """Train one run; returns what went wrong, on one line, if anything did.

    A run whose process has died goes on from its last rollout.
    """
    try:
        resume = find_checkpoint(run.folder / LAST) is not None
        train(run.config, run.folder, resume, progress=False)
    except MemoryError:  # of this process: another one may have enough
        raise
    except Exception as error:  # the other seeds go on
        text = str(error) if isinstance(error, PoiseError) else f"{type(error).__name__}: {error}"
        return " ".join(text.split())
    return None


def _all_seeds(seeds: Sequence[int], out: Path, resume: bool) -> list[int]:
    """Return the seeds of the folder and the given ones; refuses what is no list of seeds."""
    for seed in seeds:
        if seed < 0:
            raise out_of_range(seed, field="seeds", least=0)
        if list(seeds).count(seed) > 1:
            raise ConfigError(f"{seed} is given twice", field="seeds")
    if find_checkpoint(out / LAST) is not None:
        raise ConfigError("holds the run of a single seed; choose another folder",
                          source=out, field="out")  # fmt: skip
    there = [int(entry["seed"]) for entry in read_seeds(out)] if (out / SEEDS).exists() else []
    check_resume(out, resume, bool(there), "training runs", "runs")
    if not (there or seeds):
        raise ConfigError("give at least one", field="seeds")
    return there + [seed for seed in seeds if seed not in there]


def _line(entry: SeedEntry) -> str:
    start, best = evaluations(entry)
    return (
        f"seed {entry['seed']}: recovered {best['recovered']:.1%} at its best, "
        f"{start['recovered']:.1%} at the start"
    )
