"""A family of bodies -> MuJoCo: `robot.toml` gives the numbers, the family's builder an `MjSpec` and the names in it.

A robot is a folder under `models/` (or any folder with a `robot.toml`); a family is a module here with a `build` function.
"""

from twin.robots.body import Body, Frame, Jaw, JointSet, hinge_pairs
from twin.robots.robot import Robot, available, load

__all__ = ["Body", "Frame", "Jaw", "JointSet", "Robot", "available", "hinge_pairs", "load"]
