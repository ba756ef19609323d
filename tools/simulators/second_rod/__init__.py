"""A second independent simulator of the robot `continuum`, which shares no line with the twin or with tools/simulators/rod.

A diagnosis that was built beside one simulator may have learned its habits. This one reaches the same file contract by other means:
curvature as Legendre polynomials instead of joints, equilibrium by virtual work and Newton, laws written anew.

python -m tools.simulators.second_rod --out DIR [--days 30] [--seed 1]

mechanics/      what holds the backbone in its shape
  rod.py          the backbone: shape from curvature, virtual work of forces on it
  tendons.py      paths through the holes, tension along them, capstan friction
  contact.py      a wall or a post in the way
  fields.py       a magnet, a jet of air
  equilibrium.py  all of them together, solved by Newton and followed along a trial
  simulate.py     a day run through
loom.py         a cable loom at the tip: elastic-plastic sliders
robot.py        the robot as described, and as built within its tolerances
motions.py      what an operator lets the robot do
day.py          one day: trials, mounting, payloads, noise
effects/        the laws of what may be wrong, by where they act
sizing.py       how far an effect moves the markers beyond what a refit of the robot takes up
plan.py         which effects on which day
write.py        measurement sets and their truth
"""
