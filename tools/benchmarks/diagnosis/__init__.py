"""Benchmarks of the diagnosis on days of the independent simulators."""
