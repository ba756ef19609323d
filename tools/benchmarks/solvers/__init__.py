"""Benchmarks of the solvers: speed, convergence, agreement with independent formulations."""
