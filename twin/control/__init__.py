"""From a wanted tip to heating voltages, and from a soft finger's wanted shape to tendon shortenings, from sensors alone.

paths.py     tip paths on the surface that tendons reach
tip.py       wanted tip -> tensions: inverse kinematics, corrected by shape sensing
tension.py   wanted tensions -> voltages: heat feed-forward, PI, RBF network
pi.py        a PI law with limits, and the plain tension loop it makes
rbf.py       the network that learns what neither foresees
guard.py     what no spring may exceed: its voltage and its temperature
shape.py     a soft finger's wanted points -> tendon shortenings; shape_baselines.py: what that is held against
held.py      the twin of that finger as its tendons hold it, and what each of them changes

Nothing here steps a robot or reads more of it than its sensors say.
"""

from __future__ import annotations

from twin.control.guard import Guard
from twin.control.pi import PI, PlainLoop
from twin.control.rbf import RBF
from twin.control.shape import Limits, ShapeController, Step
from twin.control.shape_baselines import ConstantDirections, StrainTracking, TipTracking
from twin.control.tension import TensionLoop
from twin.control.tip import TipController

__all__ = [
    "PI",
    "RBF",
    "ConstantDirections",
    "Guard",
    "Limits",
    "PlainLoop",
    "ShapeController",
    "Step",
    "StrainTracking",
    "TensionLoop",
    "TipController",
    "TipTracking",
]
