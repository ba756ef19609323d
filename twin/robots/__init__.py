"""Robots and their families: a `robot.toml` gives the numbers, the family's module builds a body and its solvers.

robot.py          Robot: a folder under `models/`, or any folder with a `robot.toml`
schema.py         rows of a `robot.toml`: unit, range, default and meaning
family.py         what a family's module provides
families/         one module a family                      schemas/    the rows of each family's file
named_points.py   points of a body by name (`points.csv`)
effect_tables.py  [[effect]] tables of robots and twins
numbers.py        a robot's numbers in the units of its file
starter.py        a folder to start one's own robot (`twin new`); model_starter.py  that of one's own MJCF
"""

from twin.robots.family import Family, family_names, load_family
from twin.robots.robot import Robot, load, robot_names, sample

__all__ = ["Family", "Robot", "family_names", "load", "load_family", "robot_names", "sample"]
