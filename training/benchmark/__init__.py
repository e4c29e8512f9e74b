"""The push-recovery benchmark: suites with factors, trials on many processes, figures, ranking."""
