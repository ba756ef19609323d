"""Tensions to shape and back, with the friction a robot's tendons have met so far.

robot.py       a twin under its loads: forward kinematics, step by step
heated.py      the same pulled by SMA springs, stepped in time
inverse.py     the tensions for a wanted tip, by sectors or in general
"""

from twin.kinematics.heated import HeatedRobot, warmest_current
from twin.kinematics.inverse import Reach, inverse
from twin.kinematics.robot import LoadedRobot, Shape

__all__ = ["HeatedRobot", "LoadedRobot", "Reach", "Shape", "inverse", "warmest_current"]
