"""Benchmarks by theme: diagnosis, solvers, shape, control, tasks, viewer, hardware."""
