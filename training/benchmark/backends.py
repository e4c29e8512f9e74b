"""Who plays the jobs: processes of this machine, joblib, or joblib on a Ray cluster.

Whatever plays them, a job's result is the same, so that backends differ in speed alone.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack
from typing import Any, Literal

from poise.envs.errors import ConfigError, PoiseError

from ..workers import DIED, process_pool, single_threaded, without_interrupt
from .case import Result
from .play import Job

Backend = Literal["local", "joblib", "ray"]
BACKENDS: tuple[Backend, ...] = ("local", "joblib", "ray")
Finished = Iterator[tuple[Job, Result]]


def check_backend(backend: str) -> None:
    """Raise ConfigError unless the backend exists and its libraries are installed."""
    if backend not in BACKENDS:
        raise ConfigError(f"no such backend: {backend!r}", field="backend", choices=BACKENDS)
    if backend == "ray":
        try:
            import ray  # noqa: F401
        except ImportError:
            raise ConfigError(
                "needs the optional library ray: pip install 'poise[ray]'", field="backend"
            ) from None


class Crew:
    """Plays jobs on `workers` processes until closed; use as a context."""

    def __init__(self, backend: str, workers: int):
        check_backend(backend)
        self.backend, self.workers = backend, workers
        self._pool: ProcessPoolExecutor | None = None

    def __enter__(self) -> Crew:
        self._open = ExitStack()
        self._open.enter_context(single_threaded())
        if self.backend == "local":
            self._pool = process_pool(self.workers)
        elif self.backend == "ray":
            _start_ray(self.workers)
        return self

    def __exit__(self, kind: type | None, *error: Any) -> None:
        try:
            if self._pool is not None:
                self._pool.shutdown(wait=kind is None, cancel_futures=True)
            elif self.backend == "joblib":
                from joblib.externals.loky import get_reusable_executor

                get_reusable_executor().shutdown(wait=True, kill_workers=kind is not None)
        finally:
            self._open.close()

    def play(self, jobs: Sequence[Job]) -> Finished:
        """Each job with its result, as they are done.

        Raises PoiseError when a process has died.
        """
        if not jobs:
            return iter(())
        if self._pool is not None:
            return _in_pool(self._pool, jobs)
        return self._with_joblib(jobs)

    def _with_joblib(self, jobs: Sequence[Job]) -> Finished:
        import joblib

        name = "ray" if self.backend == "ray" else "loky"
        call: Callable = joblib.delayed(play_at)
        tasks = [call(job, tuple(sys.path)) for job in jobs]
        with joblib.parallel_config(name, n_jobs=self.workers):
            done = joblib.Parallel(return_as="generator_unordered", batch_size=1)(tasks)
            try:
                yield from done
            except Exception as error:
                if "Worker" in type(error).__name__ or "Pool" in type(error).__name__:
                    raise PoiseError(DIED) from None
                raise


def play_at(job: Job, path: tuple[str, ...] = ()) -> tuple[Job, Result]:
    """Play a job where modules are found as in the main process; `path` is its `sys.path`."""
    from .play import play

    sys.path += [folder for folder in path if folder not in sys.path]
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    return job, play(job)


def _in_pool(pool: ProcessPoolExecutor, jobs: Sequence[Job]) -> Finished:
    with without_interrupt():
        futures = [pool.submit(play_at, job) for job in jobs]
    try:
        for future in as_completed(futures):
            yield future.result()
    except BrokenProcessPool:
        raise PoiseError(DIED) from None


def _start_ray(workers: int) -> None:
    """Join the cluster that RAY_ADDRESS names, else start one on this machine."""
    import ray
    from ray.util.joblib import register_ray

    if not ray.is_initialized():
        settings: dict[str, Any] = {"log_to_driver": False}
        if "RAY_ADDRESS" not in os.environ:
            settings |= {"num_cpus": workers, "include_dashboard": False}
        ray.init(**settings)
    register_ray()
