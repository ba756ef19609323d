"""Benchmarks of controllers."""
