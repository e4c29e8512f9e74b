"""Jobs are done by processes of this machine, by joblib, or by joblib on a Ray cluster.

Whoever does them, a job's result is the same, so that back ends differ in speed alone.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from typing import Literal, TypeVar

from poise.baselines.allowance import carried
from poise.configs.errors import ConfigError, PoiseError, shown
from poise.configs.extras import how_to_install

from .processes import ADVICE, THREADS, WorkerPool, end_if_imported, single_threaded, tell
from .provenance import usable_cores
from .stopping import uninterrupted

Backend = Literal["local", "joblib", "ray"]
BACKENDS: tuple[Backend, ...] = ("local", "joblib", "ray")
DIED = "a worker process has died (out of memory?)"
BLOCK = 8  # jobs per process that Ray is given at a time
Job = TypeVar("Job")
Result = TypeVar("Result")


def check_backend(backend: str) -> None:
    """Raise ConfigError unless the backend exists and its libraries are installed."""
    if backend not in BACKENDS:
        raise ConfigError(f"no such backend: {shown(backend)}", field="backend", choices=BACKENDS)
    if backend == "ray":
        try:
            import ray  # noqa: F401
        except ImportError:
            raise ConfigError(
                f"needs the optional library ray: {how_to_install('ray')}", field="backend"
            ) from None


class Executor:
    """Does jobs on `workers` processes until closed; use as a context.

    None: all cores, of this machine or of the cluster; `workers` tells how many once it is open.
    What a process that dies was at is done again, once. After an error or Ctrl-C the processes are
    ended at once, whatever they are at.
    """

    def __init__(self, backend: str, workers: int | None):
        end_if_imported()
        check_backend(backend)
        self.backend, self.workers = backend, workers or usable_cores()
        self._given = workers is not None
        self._pool: WorkerPool | None = None

    def __enter__(self) -> Executor:
        self._open = ExitStack()
        self._open.enter_context(single_threaded())
        if self.backend == "local":
            self._pool = WorkerPool(self.workers)
        elif self.backend == "ray":
            cores = _start_ray(self.workers)
            self.workers = self.workers if self._given else cores
        return self

    def __exit__(self, kind: type | None, *error: object) -> None:
        try:
            if self._pool is not None:
                if kind is not None:
                    self._pool.kill()
                else:
                    self._pool.end()
            elif self.backend == "joblib":
                from joblib.externals.loky import get_reusable_executor

                get_reusable_executor().shutdown(wait=True, kill_workers=kind is not None)
        finally:
            self._open.close()

    def each(
        self, function: Callable[[Job], Result], jobs: Sequence[Job]
    ) -> Iterator[tuple[Job, Result]]:
        """Yield each job with `function(job)`, in the order that they end in; both are pickled.

        What the user allows to run here may run there.

        Raises PoiseError when processes have died of a job twice, and what the function raises.
        """
        if not jobs:
            return iter(())
        if self._pool is not None:
            return self._pool.each(carried(function), jobs)
        return self._with_joblib(carried(function), jobs)

    def _with_joblib(
        self, function: Callable[[Job], Result], jobs: Sequence[Job]
    ) -> Iterator[tuple[Job, Result]]:
        """Yield jobs and results. After a death, whose job is not known, the rest is played again,
        until nothing is done between two.
        """
        left, done = dict(enumerate(jobs)), True
        while left:
            try:
                for number, result in self._round(function, left):
                    done = True
                    yield left.pop(number), result
            except Exception as error:  # loky's and ray's own kinds
                if not any(word in type(error).__name__ for word in ("Worker", "Actor")):
                    raise
                if not done:
                    raise PoiseError(f"{DIED}, twice at the same work; {ADVICE}") from None
                tell(f"{DIED}: another one does its work again")
                done = False

    def _round(
        self, function: Callable[[Job], Result], jobs: dict[int, Job]
    ) -> Iterator[tuple[int, Result]]:
        """Numbers of jobs with results, as they are done."""
        import joblib

        ray = self.backend == "ray"
        call: Callable = joblib.delayed(do)
        tasks = [call(function, job, number, tuple(sys.path)) for number, job in jobs.items()]
        # Ray's backend gives results only when all are there: so a few at a time, by one set of
        # processes
        block = BLOCK * self.workers if ray else len(tasks)
        way = "list" if ray else "generator_unordered"
        with (
            joblib.parallel_config("ray" if ray else "loky", n_jobs=self.workers),
            joblib.Parallel(return_as=way, batch_size=1) as parallel,
        ):
            for first in range(0, len(tasks), block):
                with uninterrupted():
                    results = parallel(tasks[first : first + block])
                yield from results


def do(
    function: Callable[[Job], Result], job: Job, number: int, path: tuple[str, ...]
) -> tuple[int, Result]:
    """Do a job where modules are found as in the main process; `path` is its `sys.path`."""
    sys.path += [folder for folder in path if folder not in sys.path]
    for name in THREADS:
        os.environ.setdefault(name, "1")
    return number, function(job)


def _start_ray(workers: int) -> int:
    """Join the cluster that RAY_ADDRESS names, else start one here; returns its cores."""
    import ray
    from ray.util.joblib import register_ray

    if not ray.is_initialized():
        settings: dict[str, object] = {"log_to_driver": False}
        if "RAY_ADDRESS" not in os.environ:
            settings |= {"num_cpus": workers, "include_dashboard": False}
        ray.init(**settings)
    register_ray()
    return int(ray.cluster_resources().get("CPU", workers))
