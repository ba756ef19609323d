"""Robots and the families they are of: `robot.toml` gives the numbers, the family's module builds a body and names its solvers.

A robot is a folder under `models/` (or any folder with a `robot.toml`); a family is a module here (family.py says what it holds)
with a SCHEMA of every number it reads: unit, range, default and meaning (schema.py).
"""

from twin.robots.family import Family, families, family
from twin.robots.robot import Robot, available, load

__all__ = ["Family", "Robot", "available", "families", "family", "load"]
