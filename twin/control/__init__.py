"""From a wanted tip to heating voltages, from load cells and tendon displacements alone.

paths.py     tip paths on the surface that tendons reach
tip.py       wanted tip -> tensions: inverse kinematics, corrected by shape sensing
tension.py   wanted tensions -> voltages: heat feed-forward, PI, RBF network
pi.py        a PI law with limits, and the plain tension loop it makes
rbf.py       the network that learns what neither foresees
guard.py     what no spring may exceed: its voltage and its temperature

Nothing here steps a robot or reads more of it than its sensors say.
"""

from __future__ import annotations

from twin.control.guard import Guard
from twin.control.pi import PI, PlainLoop
from twin.control.rbf import RBF
from twin.control.tension import TensionLoop
from twin.control.tip import TipController

__all__ = ["PI", "RBF", "Guard", "PlainLoop", "TensionLoop", "TipController"]
