"""Families of bodies: each module builds a body from the numbers of a `robot.toml` and provides its solvers.

continuum.py     backbones with disks, and cast bodies, pulled by tendons (with backbone.py)
soft.py          a silicone finger
hand.py          silicone fingers on a palm
transmission.py  a jaw turned by two antagonist tendons
two_link.py      a planar finger of two rigid links
mjcf.py          any MJCF, driven by its actuators
"""
