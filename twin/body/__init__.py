"""The interface between a robot's body and the code that drives, senses, changes, simulates and draws it.

body.py          a body: its ports, senses and editing methods   solver.py        the problem and solution of a simulation
signals.py       commands and readings of a trial                loads.py         gravity, payload, forces, obstacles
route.py         friction, stretch and play of tendons; creep    drives/          motors, SMA springs, lags, and their number
hinge_chain.py   a slender body as a chain of joints             strain_cords.py  resistive strain sensors
drawable.py      arrays for drawing a body         orientation.py   rotation vectors, quaternions, angles
"""

from twin.body.body import ROPE_FEATURES, Body, Frame, Port, Sense, marker_senses, tendon_ports, tendon_senses, turn_senses
from twin.body.drives.counts import Counts
from twin.body.loads import Loads, Push
from twin.body.route import Bearing, Bumpers, Creep, Route, Rubbing
from twin.body.signals import Drive, Drives, Signals, drive_mask, interpolate_commands
from twin.body.solver import (
    BY_CONTINUATION,
    DIRECT,
    NOT_FOUND,
    SOLVE_TOLERANCE,
    Heating,
    Problem,
    Solution,
    Solver,
    Start,
    array_hash,
)

__all__ = [
    "BY_CONTINUATION",
    "DIRECT",
    "NOT_FOUND",
    "ROPE_FEATURES",
    "SOLVE_TOLERANCE",
    "Bearing",
    "Body",
    "Bumpers",
    "Counts",
    "Creep",
    "Drive",
    "Drives",
    "Frame",
    "Heating",
    "Loads",
    "Port",
    "Problem",
    "Push",
    "Route",
    "Rubbing",
    "Sense",
    "Signals",
    "Solution",
    "Solver",
    "Start",
    "array_hash",
    "drive_mask",
    "interpolate_commands",
    "marker_senses",
    "tendon_ports",
    "tendon_senses",
    "turn_senses",
]  # fmt: skip
