"""Reference implementations: slow and plain, the oracles of the tests and the baselines of the benchmarks."""
