"""A silicone body as MuJoCo's quadratic flex on the lattice of its statics: what MuJoCo moves, collides and draws.

MuJoCo's own grid of cells is even and its element linear, in a frame that turns with the cell. Here its nodes stand where the
lattice has them, carry the silicone's mass, and each cell's stiffness K is the neo-Hookean law's at rest; the force that
`stepping.py` puts in its place has that tangent, but for large strains. The metric of the integrator `discrete` is then

    M + h D + h^2 K = M + b K,        D = (b - h) K,        b: Rayleigh's coefficient of the silicone

since an implicit step h damps by itself as a coefficient of h would, and that is taken off (where b < h it stays). What is left of
the error of a step is of second order. A stiffness K' of the force is stable while K' < 2 K b / h; and MuJoCo's iterative solve of
the metric is the slower the less compressible K is: its bulk modulus, and with it the damping of changes of volume, is half of the
force's, more only where the step needs it.
"""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from scipy.spatial import KDTree

from twin.soft.body import SoftBody
from twin.soft.lattice import ACROSS, NODES
from twin.soft.newton import Parts
from twin.soft.silicone import Cells, Tangent, stiffness

AROUND, LAYERS = 16, 2  # of the mesh that touches: points around, layers a cell; it lies within 2 % of the radius
WEDGE = ((0, 1, 2, 5), (0, 1, 4, 5), (0, 3, 4, 5))  # corners of three tetrahedra; lowest corner first, so that neighbours fit
SKIN = 5e-4  # m: the mesh lies that far inside the skin, and touches at that distance
RUBBER = (0.93, 0.9, 0.82, 1.0)
NAME, BASE = "silicone", "base"
FINGER, THING = 1, 2  # who touches whom: fingers touch things, not each other
TOUCHED = 1e-9  # weight of a node by which a tendon does not move
OPEN = 1e3  # m: a dead band without end
MARGIN, BULK = 2.5, 0.5  # of the metric's bulk modulus over the least that is stable; and its least share of the force's


class Wraps(NamedTuple):
    """Where the tendons are in a compiled model: ids (t,), places (t, most) in `wrap_prm` and the unknowns (t, most) there, -1
    where a tendon has fewer."""

    tendon: np.ndarray
    place: np.ndarray
    unknown: np.ndarray


class Placed(NamedTuple):
    """Where a body is in a compiled model: coordinates (nq,) of its unknowns, in `qpos` and `qvel` alike (free joints come later),
    and its tendons."""

    dof: np.ndarray
    wraps: Wraps


def mesh(body: SoftBody) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) m and tetrahedra (m, 4) of the cone in MuJoCo's even grid: heights as if the cells were alike, radii as they
    are where the lattice has those heights."""
    cone, edges = body.cone, body.lattice.edges
    even = np.linspace(cone.clamp, cone.length, LAYERS * body.cells + 1)
    radius = cone.radius(np.interp(even, even[::LAYERS], edges)) - SKIN
    angle = 2.0 * np.pi * np.arange(AROUND) / AROUND
    ring = np.vstack([np.zeros((1, 2)), np.column_stack([np.cos(angle), np.sin(angle)])])
    points = np.concatenate([np.column_stack([r * ring, np.full(AROUND + 1, z)]) for r, z in zip(radius, even, strict=True)])
    k, n = np.arange(AROUND), AROUND + 1
    floor = np.sort(np.column_stack([np.zeros(AROUND, int), 1 + k, 1 + (k + 1) % AROUND]), axis=1)
    levels = n * np.arange(len(even) - 1)[:, None, None]
    wedges = np.concatenate([floor + levels, floor + levels + n], axis=2).reshape(-1, 6)
    tetrahedra = wedges[:, np.array(WEDGE)].reshape(-1, 4)
    arms = points[tetrahedra[:, 1:]] - points[tetrahedra[:, :1]]
    inverted = np.linalg.det(arms) < 0.0
    tetrahedra[inverted] = tetrahedra[inverted][:, [0, 2, 1, 3]]
    return points, tetrahedra


def flex(body: SoftBody, parts: Parts, step: float) -> mujoco.MjSpec:
    """The body alone, in its own frame, for `place` to finish once it is compiled, by itself or attached to more.

    Each of its tendons is there as `tendon_I`, a fixed one over the joints of the nodes that it moves with, in their order:
    MuJoCo's time for one grows with the square of their number."""
    points, tetrahedra = mesh(body)
    side = float(body.cone.radius(body.cone.clamp))
    box = np.array([[x, y, z] for x in (-side, side) for y in (-side, side) for z in (body.cone.clamp, body.cone.length)])
    spec = mujoco.MjSpec.from_string(f"""<mujoco><option timestep="{step:.9g}" integrator="discrete" solver="Newton"/>
<worldbody><body name="{BASE}">
<flexcomp name="{NAME}" type="direct" dim="3" dof="quadratic" cellcount="1 1 {body.cells}" radius="{SKIN}" mass="1"
 point="{_words(np.vstack([points, box]))}" element="{_words(tetrahedra)}" rgba="{_words(np.array(RUBBER))}">
<contact selfcollide="none" contype="{FINGER}" conaffinity="{THING}"/><elasticity young="1e5" poisson="0.3" damping="1"/>
<pin gridrange="0 0 0 2 2 0"/></flexcomp>
</body></worldbody></mujoco>""")
    even = np.linspace(body.cone.clamp, body.cone.length, body.cells + 1)
    joints: list[tuple[int, list[str]]] = []
    for node in spec.body(BASE).bodies:
        x, y, z = node.pos
        unknown = _nearest(body, np.array([[x, y, np.interp(z, even, body.lattice.edges)]]))[0]
        for axis, joint in zip("xyz", node.joints, strict=True):
            joint.name = f"{node.name}_{axis}"
        joints.append((int(unknown), [joint.name for joint in node.joints]))
    for t, weights in enumerate(parts.cables.weights, 1):
        tendon = spec.add_tendon(name=f"tendon_{t}")
        tendon.springlength = [-OPEN, OPEN]
        moving = np.abs(weights).max(axis=0) > TOUCHED
        for name in (name for unknown, names in joints if moving[unknown] for name in names):
            tendon.wrap_joint(name, 1.0)
    return spec


def place(model: mujoco.MjModel, body: SoftBody, parts: Parts, prefix: str = "", payload: float = 0.0) -> Placed:
    """Make a compiled `flex` the body it stands for: nodes, masses (`payload`, kg, at its tip), stiffness and damping.

    `mujoco.mj_setConst` must follow, for MuJoCo's own quantities of rest.
    """
    grid, f = body.lattice, mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_FLEX, prefix + NAME)
    nodes = slice(model.flex_nodeadr[f], model.flex_nodeadr[f] + model.flex_nodenum[f])
    held = model.flex_nodebodyid[nodes]
    pinned = model.body_jntnum[held] == 0
    at = np.where(pinned[:, None], model.flex_node[nodes], model.body_pos[held])  # in the body's own frame
    moved = model.flex_node0[nodes][0] - at[0]
    at[:, 2] = np.interp(at[:, 2], np.linspace(body.cone.clamp, body.cone.length, body.cells + 1), grid.edges)
    model.flex_node0[nodes] = at + moved
    unknown, bodies = _nearest(body, at[~pinned]), held[~pinned]
    tip = grid.weights(np.array([[0.0, 0.0, body.cone.length]]))[0]
    model.body_pos[bodies] = at[~pinned]
    model.body_mass[bodies] = (body.density * grid.volume + payload * tip)[unknown]
    dof = np.zeros((grid.n_free, 3), np.int64)
    dof[unknown] = model.jnt_dofadr[model.body_jntadr[bodies]][:, None] + np.arange(3)
    stiff = slice(model.flex_stiffnessadr[f], model.flex_stiffnessadr[f] + body.cells * (3 * NODES) ** 2)
    step = float(model.opt.timestep)
    model.flex_stiffness[stiff] = -_at_rest(parts, min(1.0, max(BULK, MARGIN * 0.5 * step / max(body.damping, step)))).ravel()
    model.flex_damping[f] = max(0.0, body.damping - step)
    return Placed(dof.ravel(), _wraps(model, dof.ravel(), [prefix + f"tendon_{t + 1}" for t in range(len(parts.cables.rest))]))


def _wraps(model: mujoco.MjModel, dof: np.ndarray, names: list[str]) -> Wraps:
    ids = np.array([model.tendon(name).id for name in names])
    count = model.tendon_num[ids]
    where = np.full(model.nv, -1)
    where[dof] = np.arange(len(dof))
    place, unknown = np.full((2, len(ids), int(count.max(initial=0))), -1)
    for t, (start, n) in enumerate(zip(model.tendon_adr[ids], count, strict=True)):
        place[t, :n] = start + np.arange(n)
        unknown[t, :n] = where[model.jnt_dofadr[model.wrap_objid[place[t, :n]]]]
    return Wraps(ids, place, unknown)


def _nearest(body: SoftBody, at: np.ndarray) -> np.ndarray:
    """(n,) the free node of the lattice that stands at each point (n, 3)."""
    return np.asarray(KDTree(body.lattice.nodes[ACROSS**2 :]).query(at)[1])


def _at_rest(parts: Parts, bulk: float) -> np.ndarray:
    """(c, 81, 81) N/m: tangents of the cells at rest, with a share of their bulk moduli."""
    cells, K = parts.cells, []
    for e in range(len(cells.members)):
        one = slice(e, e + 1)
        alone = Cells(
            np.arange(NODES)[None], np.arange(3 * NODES)[None], cells.gradient[one], cells.weight[one], cells.basis[one],
            cells.inverse[one], cells.shear[one], bulk * cells.bulk[one],
        )  # fmt: skip
        tangent = Tangent(np.empty((3 * NODES, 3 * NODES)), np.zeros((1, 4, 3 * NODES)), np.zeros((1, 4)))
        stiffness(np.zeros((NODES, 3)), alone, np.empty((0, 0, 6)), tangent)
        K.append(0.5 * (tangent.K + tangent.K.T))
    return np.stack(K)


def _words(values: np.ndarray) -> str:
    return " ".join(f"{v:.9g}" for v in values.ravel())
