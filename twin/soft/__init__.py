"""Silicone bodies pulled by tendons: their equilibria, and their motion.

lattice.py   cells, quadrature, weights of material points     wall.py     a wall that the skin presses
silicone.py  forces of the silicone and their tangent           creep.py    stress that relaxes
cables.py    tendons, with friction                             newton.py   equilibria, one after another
body.py      the finger as effects may edit it                  statics.py  a trial, sample by sample
room.py      a body's arrays as the compiled solve takes them   solid.py    one equilibrium at a time
flex.py      a body as MuJoCo moves and collides it             stepping.py between MuJoCo's steps
dynamics.py  a trial in motion                                  hand.py     several fingers on one palm
things.py    rigid things                                       scene.py    a hand among them
"""

from twin.soft.body import SoftBody, skin_points, straight
from twin.soft.dynamics import SoftDynamics
from twin.soft.hand import HandBody, HandDynamics, HandPath, HandStatics
from twin.soft.lattice import Cone, lattice
from twin.soft.statics import SoftPath, SoftStatics

__all__ = [
    "Cone", "HandBody", "HandDynamics", "HandPath", "HandStatics", "SoftBody", "SoftDynamics", "SoftPath", "SoftStatics", "lattice",
    "skin_points", "straight",
]  # fmt: skip
