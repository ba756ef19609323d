"""A silicone body's arrays, and work arrays, as the compiled solve takes them."""

import numpy as np

from twin.mechanics.silicone.body import CONTACT_AROUND, SoftBody, skin_points
from twin.mechanics.silicone.cables import Cables, unloaded_tendons
from twin.mechanics.silicone.material.lattice import LEVELS_ACROSS
from twin.mechanics.silicone.material.law import Cells, Tangent
from twin.mechanics.silicone.newton import MOST_UPDATES, NO_TANGENT, BodyArrays, SoftState, WorkArrays
from twin.mechanics.silicone.skin_loads import ContactSkin


def body_arrays(body: SoftBody) -> BodyArrays:
    """Return the body as the compiled solve takes it."""
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
        weights[t, -1] = grid.anchor_weights(body.paths[t, -1], body.anchor)
    skin = skin_points(body.cone)
    return BodyArrays(
        Cells(grid.members, grid.unknowns, gradient, drawn, weight, basis, inverse, shear, bulk),
        Cables(np.ascontiguousarray(body.paths), weights),
        ContactSkin(skin, grid.weights(skin), np.full(len(skin), 1.0 / CONTACT_AROUND)),
        LEVELS_ACROSS**2,
    )


def work_arrays(arrays: BodyArrays, creeps: bool) -> WorkArrays:
    """Return work arrays for a body."""
    nq, cells = 3 * arrays.cables.weights.shape[2], len(arrays.cells.members)
    tangent = Tangent(np.empty((nq, nq)), np.zeros((cells, 4, 81)), np.zeros((cells, 4)))
    relaxed = np.zeros((*arrays.cells.weight.shape, 6)) if creeps else np.empty((0, 0, 6))
    return WorkArrays(
        np.empty(nq), np.zeros((cells, 4)), np.zeros((arrays.clamped + nq // 3, 3)), tangent, unloaded_tendons(arrays.cables),
        np.zeros((len(arrays.cables.rest), nq)), relaxed, np.zeros(1, bool), np.zeros((MOST_UPDATES, nq)),
        np.zeros((MOST_UPDATES, nq)),
    )  # fmt: skip


def undeformed_state(arrays: BodyArrays, relaxed: np.ndarray) -> SoftState:
    """Return the state at rest without tension, tendons sticking; `relaxed` (k, c, q, 6) Pa is the stress that creep has taken."""
    nt, points, free = arrays.cables.weights.shape
    nq, distal = 3 * free, np.linalg.norm(np.diff(arrays.cables.rest, axis=1), axis=2)[:, ::-1].cumsum(axis=1)[:, ::-1][:, 1:]
    return SoftState(
        np.zeros(nq), np.zeros(nt), np.zeros((nt, points - 2)), np.ascontiguousarray(distal), relaxed,
        np.zeros((nq, nq), np.float32), np.full(1, NO_TANGENT),
    )  # fmt: skip
