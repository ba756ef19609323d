"""Silicone bodies pulled by tendons: equilibria and motion.

body.py                the finger, as effects edit it        hand.py        several fingers on one palm
solver_arrays.py       a body's arrays for compiled code     cables.py      tendons with friction
newton.py              equilibria of samples in turn         skin_loads.py  walls and pushes on the skin
statics.py             static trials                         skin.py        the skin as a camera sees it
single_equilibrium.py  one equilibrium at a time             drawing.py     silicone as it is drawn
material/              elasticity, lattice, creep, damping, MuJoCo's flex
motion/                motion between MuJoCo's steps, contacts, rigid things
"""

from twin.mechanics.silicone.body import SoftBody, skin_points, straight_line
from twin.mechanics.silicone.hand import HandBody, HandDynamics, HandSolution, HandStatics
from twin.mechanics.silicone.material.lattice import Cone, lattice
from twin.mechanics.silicone.motion.dynamics import SoftDynamics
from twin.mechanics.silicone.statics import SoftSolution, SoftStatics

__all__ = [
    "Cone", "HandBody", "HandDynamics", "HandSolution", "HandStatics", "SoftBody", "SoftDynamics", "SoftSolution", "SoftStatics",
    "lattice", "skin_points", "straight_line",
]  # fmt: skip
