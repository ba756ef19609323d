"""Families of bodies. Each module builds a body from the numbers of a `robot.toml` and provides its solvers.

continuum.py     backbones with disks, and cast bodies, pulled by tendons (backbone.py, continuum_schema.py, spring_rows.py)
soft.py          a silicone finger (soft_schema.py)
hand.py          silicone fingers on a palm (hand_schema.py)
transmission.py  a jaw turned by two antagonist tendons (transmission_schema.py)
two_link.py      a planar finger of two rigid links
"""
