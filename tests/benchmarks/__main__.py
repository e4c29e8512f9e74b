"""All benchmarks: `make bench`."""

from . import momentum_qp, solvers, step

for benchmark in (step, momentum_qp, solvers):
    print(f"\n{benchmark.__name__.rsplit('.', 1)[-1]}")
    benchmark.main()
