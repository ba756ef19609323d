"""A silicone body as MuJoCo's quadratic flex on the lattice of its statics, which MuJoCo moves, collides and draws.

MuJoCo's own grid of cells is even; here its nodes are moved to those of the lattice and carry the silicone's mass. The flex has no
elasticity of its own: forces and damping are those of `stepping.py`.
"""

import mujoco
import numpy as np
from scipy.spatial import KDTree

from twin.mechanics.silicone.body import SoftBody
from twin.mechanics.silicone.material.lattice import LEVELS_ACROSS

MESH_AROUND, MESH_LAYERS = 16, 2  # of the collision mesh: points around, layers a cell; it lies within 2 % of the radius
WEDGE_TETRAHEDRA = ((0, 1, 2, 5), (0, 1, 4, 5), (0, 3, 4, 5))  # corners of each; lowest first, so that neighbours match
MESH_DEPTH = 5e-4  # m, of the collision mesh inside the skin, and its contact distance
FLEX_COLOUR = (0.93, 0.9, 0.82, 1.0)
FLEX_NAME, BASE_BODY = "silicone", "base"
FINGER_BIT, THING_BIT = 1, 2  # collision bits: fingers touch things, not each other


def flex_mesh(body: SoftBody) -> tuple[np.ndarray, np.ndarray]:
    """Return points (n, 3) m and tetrahedra (m, 4) of the cone in MuJoCo's even grid.

    Heights are as if all cells were alike; radii are those of the lattice's heights.
    """
    cone, edges = body.cone, body.lattice.edges
    even = np.linspace(cone.clamp, cone.length, MESH_LAYERS * body.cells + 1)
    radius = cone.radius(np.interp(even, even[::MESH_LAYERS], edges)) - MESH_DEPTH
    angle = 2.0 * np.pi * np.arange(MESH_AROUND) / MESH_AROUND
    ring = np.vstack([np.zeros((1, 2)), np.column_stack([np.cos(angle), np.sin(angle)])])
    points = np.concatenate([np.column_stack([r * ring, np.full(MESH_AROUND + 1, z)]) for r, z in zip(radius, even, strict=True)])
    k, n = np.arange(MESH_AROUND), MESH_AROUND + 1
    floor = np.sort(np.column_stack([np.zeros(MESH_AROUND, int), 1 + k, 1 + (k + 1) % MESH_AROUND]), axis=1)
    levels = n * np.arange(len(even) - 1)[:, None, None]
    wedges = np.concatenate([floor + levels, floor + levels + n], axis=2).reshape(-1, 6)
    tetrahedra = wedges[:, np.array(WEDGE_TETRAHEDRA)].reshape(-1, 4)
    arms = points[tetrahedra[:, 1:]] - points[tetrahedra[:, :1]]
    inverted = np.linalg.det(arms) < 0.0
    tetrahedra[inverted] = tetrahedra[inverted][:, [0, 2, 1, 3]]
    return points, tetrahedra


def flex_spec(body: SoftBody, step: float) -> mujoco.MjSpec:
    """Return the body alone, in its own frame. After compilation, alone or attached to more, `finish_flex` must follow."""
    points, tetrahedra = flex_mesh(body)
    side = float(body.cone.radius(body.cone.clamp))
    box = np.array([[x, y, z] for x in (-side, side) for y in (-side, side) for z in (body.cone.clamp, body.cone.length)])
    return mujoco.MjSpec.from_string(f"""<mujoco><option timestep="{step:.9g}"/>
<worldbody><body name="{BASE_BODY}">
<flexcomp name="{FLEX_NAME}" type="direct" dim="3" dof="quadratic" cellcount="1 1 {body.cells}" radius="{MESH_DEPTH}" mass="1"
 point="{_words(np.vstack([points, box]))}" element="{_words(tetrahedra)}" rgba="{_words(np.array(FLEX_COLOUR))}">
<contact selfcollide="none" contype="{FINGER_BIT}" conaffinity="{THING_BIT}"/><elasticity young="1e5" poisson="0.3" damping="1"/>
<pin gridrange="0 0 0 2 2 0"/></flexcomp>
</body></worldbody></mujoco>""")


def finish_flex(model: mujoco.MjModel, body: SoftBody, prefix: str = "", payload: float = 0.0) -> np.ndarray:
    """Set nodes and masses of a compiled flex (`payload`, kg, at its tip). Return the coordinates (nq,) of its unknowns.

    They are the same in `qpos` and `qvel` (free joints come later). `mujoco.mj_setConst` must follow, for MuJoCo's own quantities
    of rest.
    """
    grid, f = body.lattice, mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_FLEX, prefix + FLEX_NAME)
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
    return dof.ravel()


def _nearest(body: SoftBody, at: np.ndarray) -> np.ndarray:
    """Return (n,) the free node of the lattice at each point (n, 3)."""
    return np.asarray(KDTree(body.lattice.nodes[LEVELS_ACROSS**2 :]).query(at)[1])


def _words(values: np.ndarray) -> str:
    return " ".join(f"{v:.9g}" for v in values.ravel())
