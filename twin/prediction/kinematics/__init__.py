"""Tensions to shape and back, with the friction that the tendons have met so far.

loaded_robot.py   a twin under its loads: forward kinematics, step by step
heated_robot.py   the same pulled by SMA springs, stepped in time
inverse.py        the tensions for a wanted tip position, by sectors or in general
"""

from twin.prediction.kinematics.heated_robot import HeatedRobot, warmest_current
from twin.prediction.kinematics.inverse import InverseSolution, inverse
from twin.prediction.kinematics.loaded_robot import LoadedRobot, Shape

__all__ = ["HeatedRobot", "InverseSolution", "LoadedRobot", "Shape", "inverse", "warmest_current"]
