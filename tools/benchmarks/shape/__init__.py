"""Benchmarks of shape estimation and shape control."""
