"""Benchmarks of environments, policies and the hand's tasks."""
