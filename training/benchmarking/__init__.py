"""The benchmark: suites of pushes, trials, what is measured, statistics and result folders."""
