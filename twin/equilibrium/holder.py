"""What holds a tendon, a motor or an SMA spring, as a tendon of one free length and one stretch at each step.

For a motor   gap = path - free length - stretch T - COMPRESSION sum T,   the sum over the tendons that motors hold: what all of
them pull, the backbone carries in compression. A tendon that beds in gives way by e = bedding (1 - exp(-T/T_b)) besides: at each
step it is one of free length free + e - e' T whose stretch is e' more. A motor that stalls pulls no more than T_s: a tendon that
would need more is one that gives `GIVE` a newton from there.

An SMA spring: on each linear piece Y = Y_0 + slope (e_s - e_0) of its law (twin/springs/force.py), at an elongation
e_s = e_start + path - straight path - stretch T - e, it is a tendon of free length path - (stretch + e') T - Y/slope whose stretch
is e' + 1/slope more, so gap = (Y - T)/slope. The piece is taken anew at every step (semi-smooth Newton: all pieces rise with e).
A spring that follows its tendon with play is longer by play z less, z = +1 after the path has grown, -1 after it has shrunk,
z = clip(z + the path's change / swap): between, only k = 1 - play / swap of a change reach it, and gap = (Y - T)/(slope k).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from twin.compiled import inner, jit
from twin.effects import Route
from twin.effects.tendon_friction import slip_state
from twin.springs.force import piece

STIFFEST = 1e-6  # m/N of any tendon: two taut ones may run side by side
# m/N of the backbone: three taut tendons are redundant, and this decides between them. An inextensible robot has none, 120 mm of
# NiTi of 0.8 mm 3e-6; at 3 N this is 3 um, less than any encoder sees.
COMPRESSION = 1e-6
PULL = 1e3  # N/m: some of the stiffness a held length has against its tendon's pull
LOOSEST = 0.99  # of a path's change that play may keep from a spring: all of it would leave no stiffness
GIVE = 10.0  # m/N of a motor that stalls: a millimetre less than commanded is a tenth of a millinewton more


class Held(NamedTuple):
    """Tendons held at lengths, by motors or by springs, (n_tendon,) each. Tensions count times `factor`, as in `trial.softened`."""

    which: np.ndarray  # whether a tendon is held, and not pulled with a given tension
    by_spring: np.ndarray  # whether a spring holds it
    free: np.ndarray  # m
    stretch: np.ndarray  # m/N
    straight: np.ndarray  # m, path lengths on the straight robot
    elastic: float  # m/N, stretch of the tendon alone
    factor: np.ndarray  # (1,)
    spring: np.ndarray  # (n_tendon,) `Spring.records`
    temperature: np.ndarray  # K, of the springs
    elongation: np.ndarray  # m, of the springs when they last were at rest
    tension: np.ndarray  # N, theirs then
    bedding: float  # m
    bedding_tension: float  # N
    bedded: np.ndarray  # (n_tendon,) m, e - e' T
    stall: float  # N, of motors
    play: np.ndarray  # (n_tendon,) m, of tendons that springs pull
    swap: np.ndarray  # (n_tendon,) m
    side: np.ndarray  # (n_tendon,) z when the springs last were at rest
    length: np.ndarray  # (n_tendon,) m, of the paths then


@inner
def loose(held, t, path):
    """Play (m) of tendon t at a path length (m), and the share of a change of it that reaches the spring."""
    if held.play[t] == 0.0:
        return 0.0, 1.0
    z = slip_state(held.side[t], path - held.length[t], held.swap[t])
    return held.play[t] * z, 1.0 if abs(z) == 1.0 else 1.0 - held.play[t] / held.swap[t]


@inner
def elongation(held, t, path, tension):
    """Elongation (m) of the spring that pulls tendon t at a path length (m) and a tension."""
    longer_by = held.elastic * tension / held.factor[0]
    if held.bedding > 0.0:
        longer_by += held.bedding * (1.0 - np.exp(-tension / (held.bedding_tension * held.factor[0])))
    return held.spring[t].initial_elongation + path - held.straight[t] - longer_by - loose(held, t, path)[0]


@inner
def linearise(held, s, tension):
    """Free length and stretch of the tendons that springs hold, from the piece of their law they are on, and of those that bed in;
    s[t, 0] is the path."""
    for t in range(tension.size):
        if held.by_spring[t]:
            e = elongation(held, t, s[t, 0], tension[t])
            Y, slope = piece(held.spring, t, held.temperature[t], e, held.elongation[t], held.tension[t])
            elastic = held.elastic / held.factor[0]
            if held.bedding > 0.0:
                over = held.bedding_tension * held.factor[0]
                elastic += held.bedding / over * np.exp(-tension[t] / over)
            share = loose(held, t, s[t, 0])[1]
            held.free[t] = s[t, 0] - (elastic * tension[t] + Y / slope) / share
            held.stretch[t] = (elastic + 1.0 / (slope * held.factor[0])) / share
        elif held.bedding > 0.0 or held.stall < np.inf:
            bed_in(held, t, tension[t])
    if held.stall < np.inf:
        for t in range(tension.size):
            if held.which[t] and not held.by_spring[t]:
                give_way(held, t, s[t, 0], tension)


@inner
def bed_in(held, t, tension):
    """What is left of the bedding in of tendon t at a tension, and its stretch there."""
    over = held.bedding_tension * held.factor[0]
    loose = np.exp(-tension / over)
    held.bedded[t] = held.bedding * (1.0 - loose * (1.0 + tension / over))
    held.stretch[t] = max(held.elastic, STIFFEST) / held.factor[0] + held.bedding / over * loose


@inner
def give_way(held, t, path, tension):
    """Tendon t on the piece where its motor stalls, if at this path and these tensions it would pull more than that."""
    if tension[t] / held.factor[0] + PULL * lack(held, t, path, tension) > held.stall:
        longer_by = max(held.elastic, STIFFEST) * held.stall + held.bedding * (1.0 - np.exp(-held.stall / held.bedding_tension))
        held.bedded[t] = longer_by - GIVE * held.stall
        held.stretch[t] = GIVE / held.factor[0]


@inner
def longer(held, i, j):
    """How much (m/N) tendon j's tension gives tendon i, both held: by i's own stretch and by the backbone's compression."""
    own = held.stretch[i] if i == j else 0.0
    if held.by_spring[i] or held.by_spring[j] or not (held.which[i] and held.which[j]):
        return own
    return own + COMPRESSION / held.factor[0]


@inner
def lack(held, t, path, tension):
    """How much too long (m) tendon t is at a path length (m) and all tensions."""
    gap = path - held.free[t] - held.bedded[t]
    for j in range(tension.size):
        gap -= longer(held, t, j) * tension[j]
    return gap


@inner
def rest(held, t, path, tension):
    """Spring t comes to rest at a path length (m) under a tension (N)."""
    held.elongation[t] = elongation(held, t, path, tension * held.factor[0])
    held.tension[t] = tension
    if held.play[t] > 0.0:
        held.side[t] = slip_state(held.side[t], path - held.length[t], held.swap[t])
    held.length[t] = path


def of_play(route: Route, zero: np.ndarray, by_spring: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """`play`, `swap`, `side` and `length` of `Held` before anything has moved, for paths of `zero` (n_tendon,) m."""
    play = by_spring * np.array(route.play or np.zeros(zero.size), float)
    return play, np.maximum(np.array(route.swap, float), play / LOOSEST), np.zeros(zero.size), zero.copy()


@jit
def remember(held, s, tension):
    """The springs come to rest: their elongations and tensions become those their law goes on from."""
    for t in range(tension.size):
        if held.by_spring[t]:
            rest(held, t, s[t, 0], tension[t] / held.factor[0])
