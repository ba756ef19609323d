"""Solve the equilibria of a chain, every sample from the one before."""

from dataclasses import dataclass

import numpy as np

from twin.mechanics.silicone import SoftStatics
from twin.mechanics.silicone.single_equilibrium import SoftEquilibrium, hang_at_rest, move_equilibrium
from twin.mechanics.silicone.skin_loads import push_surface
from twin.shape.training_data.draw import CHAIN_LENGTH, STEPS_PER_TARGET, Chain


@dataclass(frozen=True)
class SolvedChain:
    """The samples of one chain.

    Nodal displacements `nodes` (n, n_free, 3) m, `strain` (n, s), `resistance` (n, s) ohm, `tension` (n, t) N, `command` (n, t) m,
    and whether each sample converged (n,).
    """

    nodes: np.ndarray
    strain: np.ndarray
    resistance: np.ndarray
    tension: np.ndarray
    command: np.ndarray
    converged: np.ndarray


def solve_chain(statics: SoftStatics, chain: Chain, weight: np.ndarray) -> SolvedChain:
    """Solve the chain's samples in order. A sample without an equilibrium repeats the shape before it, not `converged`."""
    body, solid = statics.body, SoftEquilibrium(statics.arrays)
    skin = push_surface(body.cone, body.cells)
    shape = solid.undeformed()
    hanging = hang_at_rest(solid, shape, weight)
    nt = len(hanging)
    nodes, tension = np.empty((CHAIN_LENGTH, *shape.u.shape)), np.empty((CHAIN_LENGTH, nt))
    command, converged = np.empty((CHAIN_LENGTH, nt)), np.zeros(CHAIN_LENGTH, bool)
    displacement, force, goals = np.zeros(nt), np.zeros_like(weight), [skin.nodal_force(p) for p in chain.pushes]
    for i in range(CHAIN_LENGTH):
        target, share = i // STEPS_PER_TARGET, 1.0 / (STEPS_PER_TARGET - i % STEPS_PER_TARGET)
        goal, push = displacement + share * (chain.command[target] - displacement), force + share * (goals[target] - force)
        shape, converged[i] = move_equilibrium(solid, shape, hanging, (displacement, weight + force), (goal, weight + push))
        displacement, force = goal, push
        nodes[i], tension[i], command[i] = shape.u, shape.tension, goal
    sensed = statics.sensor_signals(nodes)
    return SolvedChain(nodes, sensed["strain"], sensed["sensor"], tension, command, converged)
