"""All benchmarks: `make bench`."""

from tests.performance import (
    flywheel_limit,
    momentum_qp,
    motion_tick,
    qp_set,
    scaling,
    solvers,
    startup,
    step,
    stepping,
    steps,
    vector,
    walking,
)

for benchmark in (
    step,
    stepping,
    steps,
    vector,
    motion_tick,
    walking,
    momentum_qp,
    solvers,
    qp_set,
    scaling,
    startup,
    flywheel_limit,
):
    print(f"\n{benchmark.__name__.rsplit('.', 1)[-1]}")
    benchmark.main()
