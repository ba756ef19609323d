"""The chain's arrays, from a compiled MuJoCo model of a hinge chain."""

from collections.abc import Mapping

import mujoco
import numpy as np

from twin.body.hinge_chain import HingeChain, hinge_pairs
from twin.mechanics.rod.balance.chain import Chain
from twin.mechanics.rod.balance.elastic import SET_COUPLING


def compile_chain(body: HingeChain, model: mujoco.MjModel, data: mujoco.MjData) -> Chain:
    """Return the chain's arrays, with MuJoCo's data at the straight rest."""
    site = np.vectorize(lambda name: model.site(name).id, otypes=[np.int64])
    dof = {model.joint(i).name: int(model.joint(i).dofadr[0]) for i in range(model.njnt)}
    n_piece = np.array([len(tendon) - 1 for tendon in body.tendon_sites], np.int64)
    longest = int(n_piece.max())
    hole = site(np.array([[*tendon, *tendon[-1:] * (longest + 1 - len(tendon))] for tendon in body.tendon_sites]))
    disk = site(np.array(body.disks))
    joints = _joint_arrays(body, model, dof)
    n_hinge = np.zeros(model.nbody, np.int64)  # from the base to and including each body
    for b in range(1, model.nbody):
        n_hinge[b] = n_hinge[model.body_parentid[b]] + model.body_dofnum[b]
    moved_body, arcs = model.dof_bodyid.astype(np.int64), body.pushes and body.straight_tendons
    first_joint = n_hinge[model.site_bodyid[hole[n_piece.argmax()]]]
    chain = Chain(
        anchor=data.xanchor,
        axis=data.xaxis,
        subtree_centre=data.subtree_com,
        site=data.site_xpos,
        qpos=data.qpos,
        **joints,
        first_bend=np.array([min(dof[at.bend_x], dof[at.bend_y]) for at in body.joints], np.int64),
        slide=np.array([dof[at.slide] for at in body.joints if at.slide is not None], np.int64),
        channel_lever=np.zeros((len(body.tendon_sites) if arcs or any(at.slide for at in body.joints) else 0, model.nv)),
        stiffening=float(body.stiffening),
        handedness=np.linalg.det(model.jnt_axis[joints["is_hinge"] > 0.0].reshape(-1, 3, 3)),
        body=moved_body,
        mass=model.body_subtreemass[moved_body].copy(),
        hole=hole,
        n_piece=n_piece,
        first_joint=first_joint,
        disk=disk,
        disk_joints=n_hinge[model.site_bodyid[disk]],
        arc=_arc_table(body, dof, first_joint) if arcs else None,
        arc_length=np.zeros((len(hole), longest)) if arcs else None,
        marker=site(np.array(body.marker_sites)),
    )
    mujoco.mj_kinematics(model, data)
    if chain.channel_lever.size:
        _set_channel_lever(chain)
    if chain.arc_length is not None:
        chain.arc_length[:] = np.linalg.norm(np.diff(chain.site[hole], axis=1), axis=2)
    return chain


def _arc_table(body: HingeChain, dof: Mapping[str, int], first_joint: np.ndarray) -> np.ndarray:
    """Return `Chain.arc`: of each bending hinge itself, its set, the rods' piece that it bends, and its axis."""
    hinges = [(dof[name], j, a) for j, at in enumerate(body.joints) for a, name in enumerate((at.bend_x, at.bend_y))]
    piece = [int(np.searchsorted(first_joint, i, side="right")) - 1 for i, _, _ in hinges]
    inside = [d < len(first_joint) - 1 for d in piece]  # some may lie beyond the longest rod's end
    return np.array([(i, j, d, a) for (i, j, a), d, of in zip(hinges, piece, inside, strict=True) if of], np.int64).reshape(-1, 4)


def _joint_arrays(body: HingeChain, model: mujoco.MjModel, dof: Mapping[str, int]) -> dict[str, np.ndarray]:
    """Return the chain's arrays (nv,) of joint properties by field name; `dof` are the joints' indices."""
    stiffness = model.jnt_stiffness.reshape(model.nv, -1)[:, 0].copy()
    partner, coupling, slenderness = np.arange(model.nv), np.zeros(model.nv), np.zeros(model.nv)
    unit, is_hinge, is_twist = np.ones(model.nv), np.ones(model.nv), np.zeros(model.nv, bool)
    for one, other in hinge_pairs(body) if body.straight_tendons else ():
        a, b = dof[one], dof[other]
        partner[a], partner[b] = b, a
        coupling[[a, b]] = SET_COUPLING * 0.5 * (stiffness[a] + stiffness[b])
    for at in body.joints:
        is_twist[dof[at.twist]] = True
        if at.slide is not None:
            unit[dof[at.slide]], is_hinge[dof[at.slide]] = at.length, 0.0
        for bend in (at.bend_x, at.bend_y) if body.straight_tendons and not body.pushes else ():
            slenderness[dof[bend]] = 4.0 * at.length / stiffness[dof[bend]]
    return {
        "stiffness": stiffness, "unit": unit, "is_hinge": is_hinge, "is_twist": is_twist, "slenderness": slenderness,
        "partner": partner, "coupling": coupling,
    }  # fmt: skip


def _set_channel_lever(chain: Chain) -> None:
    """Set `channel_lever`: by how much a bend lengthens the piece of channel that it is in, the body being straight."""
    ends = chain.site[chain.hole]
    span = np.diff(ends, axis=1)
    along = span / np.maximum(np.linalg.norm(span, axis=2, keepdims=True), np.finfo(float).tiny)
    joints = np.arange(chain.first_joint[0], chain.first_joint[-1])
    piece = np.searchsorted(chain.first_joint, joints, side="right") - 1
    turned = np.cross(chain.axis[joints], ends[:, piece + 1] - chain.anchor[joints])
    bends = (chain.is_hinge[joints] > 0.0) & ~chain.is_twist[joints] & (piece < chain.n_piece[:, None])
    chain.channel_lever[:, joints] = bends * (turned * along[:, piece]).sum(axis=2)
