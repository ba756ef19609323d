"""Controllers: from a wanted tip to heating voltages, and from a soft finger's wanted shape to tendon shortenings.

tip_controller.py    wanted tip -> tensions: inverse kinematics, corrected by shape sensing
tension_loop.py      wanted tensions -> voltages: heat feed-forward, PI, RBF network
pi_controller.py     PI with limits
rbf_network.py       a network that learns the loop's errors online
heating_guard.py     limits of voltage and temperature of springs
tip_paths.py         tip paths on the surface that tendons reach
shape_controller.py  a soft finger's wanted points -> tendon shortenings
strain_tracking.py   the same steps, tracking strains instead of points
held_finger.py       equilibria of a finger with held tendons, and their response to tensions

Nothing here steps a robot or reads more of it than its sensors.
"""

from twin.control.heating_guard import HeatingGuard
from twin.control.pi_controller import PIController
from twin.control.rbf_network import RBFNetwork
from twin.control.shape_controller import ControlStep, ShapeController, TensionLimits
from twin.control.strain_tracking import BendTracking, StrainTracking
from twin.control.tension_loop import TensionLoop
from twin.control.tip_controller import TipController

__all__ = [
    "BendTracking",
    "ControlStep",
    "HeatingGuard",
    "PIController",
    "RBFNetwork",
    "ShapeController",
    "StrainTracking",
    "TensionLimits",
    "TensionLoop",
    "TipController",
]
