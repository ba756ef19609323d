"""Tendons held at lengths while a chain moves: wound by motors, or pulled by SMA springs that currents heat.

Each is a MuJoCo tendon along its whole path and, while taut, a spring of the compliance and free length that tendon_actuation.py
gives:

    T+ = max(0, (path+ - free+) / stretch),    of a rod   T+ = (path+ - free+) / stretch,
    free = straight path - displacement + BACKBONE_COMPLIANCE S,    S' = (sum T - S) / lag

MuJoCo's implicit integration takes that spring, so that its 1e6 N/m does not bound the step. A tendon with T < 0 is slack from the
next step on, until its path is longer than free; a rod never is. Bowing of the backbone and its compression by the total tension S
follow from step to step. Friction's loss along the tendon goes to its segments' motors with the tension of the step before. An SMA
spring's force law is linearised at every step, on its present piece, at its present temperature.
"""

from typing import NamedTuple

import mujoco
import numpy as np

from twin.body import Drive, Problem
from twin.body.drives.spring import placeholder_springs
from twin.body.hinge_chain import HingeChain
from twin.foundation.by_reference import by_reference
from twin.foundation.compiled import jit_internal
from twin.mechanics.rod import ChainSolution, Equilibrium
from twin.mechanics.rod.balance.tendon_actuation import (
    BACKBONE_COMPLIANCE,
    LEAST_STRETCH,
    Actuation,
    commit_spring,
    initial_backlash,
)
from twin.mechanics.springs.heat import heated_temperature


@by_reference
class HeldTendons(NamedTuple):
    """The actuation of the held tendons, and MuJoCo's arrays of their whole-path tendons."""

    actuation: Actuation
    index: np.ndarray  # (n_tendon,) of its MuJoCo tendon, -1 where a tension is given
    stiffness: np.ndarray  # (ntendon, k) N/m, MuJoCo's
    band: np.ndarray  # (ntendon, 2) m, MuJoCo's, between which a tendon does not pull; of rods the ends are one
    bowing: np.ndarray  # (n_tendon,) m, as last evaluated
    total_tension: np.ndarray  # (1,) N, S
    lag: float  # steps


def tendon_name(t: int) -> str:
    """Return the name of the MuJoCo tendon along the whole path of tendon t (from 0)."""
    return f"tendon_{t + 1}_held"


def add_held_tendons(spec: mujoco.MjSpec, body: HingeChain, which: np.ndarray) -> None:
    """Add MuJoCo tendons for those of `which` (n_tendon,) to a model, as springs without tension yet."""
    for t in np.flatnonzero(which).tolist():
        tendon = spec.add_tendon(name=tendon_name(t))
        tendon.stiffness, tendon.springlength = [1.0, 0, 0], [0.0, 1.0]
        for site in body.tendon_sites[t]:
            tendon.wrap_site(site)


def hold_tendons(problem: Problem, compiled: Equilibrium, start: ChainSolution, zero: np.ndarray) -> HeldTendons:
    """Return the held tendons at rest in `start`, which MuJoCo's data holds; `zero` (n_tendon,) m as `Equilibrium.zero_path`."""
    model, data, nt, path, tension = compiled.model, compiled.data, problem.command.shape[1], start.path[0], start.tension[0]
    motors, springs = problem.drive_mask(Drive.DISPLACEMENT), problem.drive_mask(Drive.CURRENT)
    stretch = max(problem.route.stretch, LEAST_STRETCH)
    records = placeholder_springs(nt).records if problem.heating is None else problem.heating.spring.records
    elongated = records["initial_elongation"] + path - zero - problem.route.elongation(tension)
    actuation = Actuation(
        motors | springs, springs, np.zeros(nt), np.full(nt, stretch), zero, float(problem.route.stretch),
        np.ones(1), records, start.others["temperature"][0].copy(), elongated, tension.copy(),
        float(problem.route.bedding), float(problem.route.bedding_tension), np.zeros(nt), float(problem.route.stall_tension),
        *initial_backlash(problem.route, zero, springs), compiled.pushes,
    )  # fmt: skip
    index = np.array([model.tendon(tendon_name(t)).id if actuation.held[t] else -1 for t in range(nt)], np.int64)
    stiffness, band, bowing = model.tendon_stiffness.reshape(model.ntendon, -1), model.tendon_lengthspring, np.zeros(nt)
    for t in np.flatnonzero(actuation.held):
        k = index[t]
        stiffness[k, 0], band[k] = 1.0 / stretch, data.ten_length[k] - stretch * tension[t]
        bowing[t] = path[t] - data.ten_length[k]
    # With this lag the compression of a backbone that does not bend settles within a step.
    lag = float(1.0 + motors.sum() * BACKBONE_COMPLIANCE / stretch)
    return HeldTendons(actuation, index, stiffness, band, bowing, np.array([tension[motors].sum()]), lag)


@jit_internal
def held_tension(tendons, t, length):
    """Return the tension (N) of held tendon t at a length (m) between its holes."""
    k = tendons.index[t]
    longer_by = length - tendons.band[k, 1]
    return tendons.stiffness[k, 0] * (longer_by if tendons.actuation.pushes else max(0.0, longer_by))


@jit_internal
def update_total_tension(tendons, tension):
    """Advance the total tension S of the motors' tendons by a step."""
    total = 0.0
    for t in range(tension.size):
        if tendons.actuation.held[t] and not tendons.actuation.by_spring[t]:
            total += tension[t]
    tendons.total_tension[0] += (total - tendons.total_tension[0]) / tendons.lag


@jit_internal
def set_slack_band(tendons, state, t):
    """Set stiffness and slack band of held tendon t at a path length of state.s[t, 0] (m)."""
    actuation, k, path = tendons.actuation, tendons.index[t], state.s[t, 0]
    free_length = actuation.free_length[t]
    if not actuation.by_spring[t]:
        free_length += actuation.bedding_offset[t] + BACKBONE_COMPLIANCE * tendons.total_tension[0]
    taut = state.T[t] > 0.0 or path > free_length or actuation.pushes
    tendons.stiffness[k, 0] = 1.0 / actuation.stretch[t]
    tendons.band[k, 1] = free_length - tendons.bowing[t]
    tendons.band[k, 0] = tendons.band[k, 1] if taut else 0.0


@jit_internal
def heat_spring(tendons, state, t, current, ambient, dt):
    """Commit spring t at rest, then heat it for dt (s) by a current (A) in surroundings at `ambient` (K)."""
    actuation = tendons.actuation
    commit_spring(actuation, t, state.s[t, 0], state.T[t])
    actuation.temperature[t] = heated_temperature(
        actuation.spring, t, actuation.temperature[t], actuation.elongation[t], current, ambient, dt
    )
