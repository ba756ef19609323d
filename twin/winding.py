"""Tendons held at lengths while a chain moves: wound up by motors, or pulled by SMA springs that currents heat.

Each is a MuJoCo tendon along its whole path and, while taut, a spring of the stretch and free length that holder.py gives it:

    T+ = max(0, (path+ - free+) / stretch),    free = straight path - displacement + COMPRESSION S,    S' = (sum T - S) / lag

`discrete` integrates that spring implicitly, so that its 1e6 N/m bound no step. One that comes out with T < 0 is slack from the
next step on, until its path is longer than free. What the bowing of the backbone takes from the path and what all tendons together
press out of it, S, follow from step to step; friction's loss along the tendon goes to its segments' motors with the tension of the
step before. An SMA spring's law is taken anew at every step, on the piece where it is, at the temperature to which the current has
heated it.
"""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np

from twin.body import Problem
from twin.compiled import inner
from twin.effects import Drive
from twin.equilibrium import ChainPath, Equilibrium
from twin.equilibrium.holder import COMPRESSION, STIFFEST, Held, of_play, rest
from twin.hinges import HingeChain
from twin.springs.heat import heated
from twin.springs.spring import no_springs


class Winding(NamedTuple):
    """What holds the tendons, and MuJoCo's own arrays of the tendons along whole paths: their numbers (n_tendon,), -1 where a
    tension is given, stiffnesses and bands; bowing (n_tendon,) m as it was last found, S (1,) N and its lag in steps."""

    held: Held
    number: np.ndarray
    stiffness: np.ndarray
    band: np.ndarray
    bowing: np.ndarray
    shared: np.ndarray
    lag: float


def whole(t: int) -> str:
    """The name of tendon t (from 0) along its whole path."""
    return f"tendon_{t + 1}_held"


def hang(spec: mujoco.MjSpec, body: HingeChain, which: np.ndarray) -> None:
    """Add those tendons (n_tendon,) that are held to a model, as springs that pull nothing yet."""
    for t in np.flatnonzero(which).tolist():
        tendon = spec.add_tendon(name=whole(t))
        tendon.stiffness, tendon.springlength = [1.0, 0, 0], [0.0, 1.0]
        for site in body.tendons[t]:
            tendon.wrap_site(site)


def winding(problem: Problem, moving: Equilibrium, start: ChainPath, zero: np.ndarray) -> Winding:
    """Of tendons that rest as in `start`, where MuJoCo's data is; `zero` (n_tendon,) m as `Equilibrium.zero_path`."""
    model, data, nt, path, tension = moving.model, moving.data, problem.command.shape[1], start.path[0], start.tension[0]
    motors, springs = problem.which(Drive.DISPLACEMENT), problem.which(Drive.CURRENT)
    stretch = max(problem.route.stretch, STIFFEST)
    records = no_springs(nt).records if problem.heating is None else problem.heating.spring.records
    elongated = records["initial_elongation"] + path - zero - problem.route.elongation(tension)
    held = Held(
        motors | springs, springs, np.zeros(nt), np.full(nt, stretch), zero, float(problem.route.stretch),
        np.ones(1), records, start.others["temperature"][0].copy(), elongated, tension.copy(),
        float(problem.route.bedding), float(problem.route.bedding_tension), np.zeros(nt), float(problem.route.stall),
        *of_play(problem.route, zero, springs),
    )  # fmt: skip
    number = np.array([model.tendon(whole(t)).id if held.which[t] else -1 for t in range(nt)], np.int64)
    stiffness, band, bowing = model.tendon_stiffness.reshape(model.ntendon, -1), model.tendon_lengthspring, np.zeros(nt)
    for t in np.flatnonzero(held.which):
        k = number[t]
        stiffness[k, 0], band[k] = 1.0 / stretch, data.ten_length[k] - stretch * tension[t]
        bowing[t] = path[t] - data.ten_length[k]
    # This lag settles in a step what all press out of a backbone that does not bend.
    return Winding(
        held, number, stiffness, band, bowing, np.array([tension[motors].sum()]), float(1.0 + motors.sum() * COMPRESSION / stretch)
    )


@inner
def pulled(winding, t, length):
    """Tension (N) of the held tendon t at a length (m) between its holes."""
    k = winding.number[t]
    return winding.stiffness[k, 0] * max(0.0, length - winding.band[k, 1])


@inner
def press(winding, tension):
    """What the motors' tendons press out of the backbone, after a step."""
    total = 0.0
    for t in range(tension.size):
        if winding.held.which[t] and not winding.held.by_spring[t]:
            total += tension[t]
    winding.shared[0] += (total - winding.shared[0]) / winding.lag


@inner
def let_go(winding, state, t):
    """The band in which held tendon t, at state.s[t, 0] (m) of path, pulls nothing."""
    held, k, path = winding.held, winding.number[t], state.s[t, 0]
    free = held.free[t]
    if not held.by_spring[t]:
        free += held.bedded[t] + COMPRESSION * winding.shared[0]
    taut = state.T[t] > 0.0 or path > free
    winding.stiffness[k, 0] = 1.0 / held.stretch[t]
    winding.band[k, 1] = free - winding.bowing[t]
    winding.band[k, 0] = winding.band[k, 1] if taut else 0.0


@inner
def heat(winding, state, t, current, ambient, dt):
    """Spring t comes to rest, and is heated for dt (s) by a current (A) in surroundings at `ambient` (K)."""
    held = winding.held
    rest(held, t, state.s[t, 0], state.T[t])
    held.temperature[t] = heated(held.spring, t, held.temperature[t], held.elongation[t], current, ambient, dt)
