"""All benchmarks: `make bench`."""

from . import momentum_qp, solvers, step, vector

for benchmark in (step, vector, momentum_qp, solvers):
    print(f"\n{benchmark.__name__.rsplit('.', 1)[-1]}")
    benchmark.main()
