"""A soft body's arrays, and room to work in, as the compiled solve takes them."""

from __future__ import annotations

import numpy as np

from twin.soft.body import AROUND, SoftBody, skin_points
from twin.soft.cables import Cables, unpulled
from twin.soft.lattice import ACROSS
from twin.soft.newton import LEARNT, NONE, Parts, Room, State
from twin.soft.silicone import Cells, Tangent
from twin.soft.wall import Skin


def parts_of(body: SoftBody) -> Parts:
    """The body as the compiled solve takes it."""
    grid = body.lattice
    gradient, local = grid.gradients
    weight, drawn = grid.quadrature[1] * body.fibre, 1.0 / body.fibre
    if (drawn != 1.0).any():
        gradient = gradient.copy()
        gradient[..., 2::3] *= drawn[:, None]
    basis = np.concatenate([np.ones((*local.shape[:2], 1)), local], axis=-1)
    inverse = np.linalg.inv(np.einsum("eqa,eq,eqb->eab", basis, weight, basis))
    E, nu = body.youngs_modulus, body.poisson
    shear, bulk = body.shear * (E / (2.0 * (1.0 + nu))), body.bulk * (E / (3.0 * (1.0 - 2.0 * nu)))
    nt, points, _ = body.paths.shape
    weights = grid.weights(body.paths.reshape(-1, 3)).reshape(nt, points, -1)
    for t in range(nt):
        weights[t, -1] = grid.spread(body.paths[t, -1], body.anchor)
    skin = skin_points(body.cone)
    return Parts(
        Cells(grid.members, grid.unknowns, gradient, drawn, weight, basis, inverse, shear, bulk),
        Cables(np.ascontiguousarray(body.paths), weights),
        Skin(skin, grid.weights(skin), np.full(len(skin), 1.0 / AROUND)),
        ACROSS**2,
    )


def room_for(parts: Parts, creeps: bool) -> Room:
    """Arrays to work in."""
    nq, cells = 3 * parts.cables.weights.shape[2], len(parts.cells.members)
    tangent = Tangent(np.empty((nq, nq)), np.zeros((cells, 4, 81)), np.zeros((cells, 4)))
    relaxed = np.zeros((*parts.cells.weight.shape, 6)) if creeps else np.empty((0, 0, 6))
    return Room(
        np.empty(nq), np.zeros((cells, 4)), np.zeros((parts.clamped + nq // 3, 3)), tangent, unpulled(parts.cables),
        np.zeros((len(parts.cables.rest), nq)), relaxed, np.zeros(1, bool), np.zeros((LEARNT, nq)), np.zeros((LEARNT, nq)),
    )  # fmt: skip


def undeformed(parts: Parts, taken: np.ndarray) -> State:
    """At rest without tension, tendons sticking; `taken` (k, c, q, 6) Pa is the stress that creep has left."""
    nt, points, free = parts.cables.weights.shape
    nq, beyond = 3 * free, np.linalg.norm(np.diff(parts.cables.rest, axis=1), axis=2)[:, ::-1].cumsum(axis=1)[:, ::-1][:, 1:]
    return State(
        np.zeros(nq), np.zeros(nt), np.zeros((nt, points - 2)), np.ascontiguousarray(beyond), taken,
        np.zeros((nq, nq), np.float32), np.full(1, NONE),
    )  # fmt: skip
