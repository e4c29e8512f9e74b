"""All benchmarks: `make bench`."""

from . import momentum_qp, qp_set, scaling, solvers, startup, step

for benchmark in (step, momentum_qp, solvers, qp_set, scaling, startup):
    print(f"\n{benchmark.__name__.rsplit('.', 1)[-1]}")
    benchmark.main()
