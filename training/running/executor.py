"""Back ends that run jobs: processes of this machine, joblib, or joblib on a Ray cluster.

All back ends give the same results and differ only in speed.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from typing import Literal, TypeVar

from poise.baselines.allowance import carrying_allowance
from poise.configs.errors import ConfigError, PoiseError, shown
from poise.configs.extras import how_to_install

from .processes import ADVICE, THREADS, WorkerPool, end_if_imported, single_threaded, tell
from .provenance import usable_cores
from .stopping import uninterrupted

Backend = Literal["local", "joblib", "ray"]
BACKENDS: tuple[Backend, ...] = ("local", "joblib", "ray")
DIED = "a worker process has died (out of memory?)"
BLOCK = 8  # jobs per process that are submitted to Ray at a time
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
    """Run jobs on `workers` processes until closed; use as a context.

    With None, use all cores of this machine or of the cluster; once open, `workers` is their
    number. The job of a process that dies is repeated once. After an error or Ctrl-C all
    processes are ended at once.
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
        """Yield each job with `function(job)`, in order of completion; both are pickled.

        Workers inherit the plugins that the user allows.

        Raises PoiseError when two processes have died on one job, and whatever the function raises.
        """
        if not jobs:
            return iter(())
        if self._pool is not None:
            return self._pool.each(carrying_allowance(function), jobs)
        return self._with_joblib(carrying_allowance(function), jobs)

    def _with_joblib(
        self, function: Callable[[Job], Result], jobs: Sequence[Job]
    ) -> Iterator[tuple[Job, Result]]:
        """Yield jobs and results.

        joblib does not report which job a dead worker had, so all remaining jobs are repeated,
        until two deaths follow without a finished job in between.
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
                    raise PoiseError(f"{DIED}, twice on the same work; {ADVICE}") from None
                tell(f"{DIED}: its work is repeated")
                done = False

    def _round(
        self, function: Callable[[Job], Result], jobs: dict[int, Job]
    ) -> Iterator[tuple[int, Result]]:
        """Yield numbers of jobs with results, in order of completion."""
        import joblib

        ray = self.backend == "ray"
        call: Callable = joblib.delayed(do)
        tasks = [call(function, job, number, tuple(sys.path)) for number, job in jobs.items()]
        # Ray's backend returns results only when all are complete, so it gets a few jobs at a time
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
    """Run a job with the module search path of the main process; `path` is its `sys.path`."""
    sys.path += [folder for folder in path if folder not in sys.path]
    for name in THREADS:
        os.environ.setdefault(name, "1")
    return number, function(job)


def _start_ray(workers: int) -> int:
    """Join the cluster at RAY_ADDRESS, else start a local one; return its number of cores."""
    import ray
    from ray.util.joblib import register_ray

    if not ray.is_initialized():
        settings: dict[str, object] = {"log_to_driver": False}
        if "RAY_ADDRESS" not in os.environ:
            settings |= {"num_cpus": workers, "include_dashboard": False}
        ray.init(**settings)
    register_ray()
    return int(ray.cluster_resources().get("CPU", workers))
