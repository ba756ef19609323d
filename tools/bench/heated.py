"""March of a rod whose tendons SMA springs pull: rod and springs meet at a length and a tension, row by row.

The rod is solved with each spring replaced by its tangent, T = s + k (e - e_0), which is a tendon held at a length with a stretch
of 1/k; the tangent is taken again where the rod went until spring and tendon agree. Where they do not, the row comes in parts.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tools.bench.frames import Mesh, integrate
from tools.bench.march import SMALLEST, NoEquilibrium, Record, _commit, distal_lengths
from tools.bench.springs import FIRST_ELONGATION, GF, Springs
from tools.bench.statics import Body, Load, equilibrium, new_pose
from tools.bench.tendons import Friction, lay

AGREED = 1e-4  # gf between spring and tendon
TRIES = 12


class Heat(NamedTuple):
    """A sequence of rows; row 0 is reached cold from the unloaded straight robot."""

    current: np.ndarray  # (n, T) A, from this row to the next
    ambient: np.ndarray  # (n,) degC
    weight: np.ndarray  # (n,) factor on the dead loads
    softness: np.ndarray  # (n,) factor on the compliance
    dt: np.ndarray  # (n,) s taken to reach the row


def march_heated(
    mesh: Mesh, body: Body, load: Load, friction: Friction, springs: Springs, heat: Heat, record: Record, stretch: float = 0.0
) -> np.ndarray:
    """March, fill `record` and return the springs' temperatures (m, T) in degC at the rows it keeps. Raises NoEquilibrium."""
    N, G = body.rest.shape[:2]
    T = body.holes.shape[1]
    pose = new_pose(N, G, T, len(friction.stroke))
    u = body.rest.copy()
    integrate(u, body.pitch, mesh, pose.node_R, pose.node_r, pose.disk_R, pose.disk_r)
    lay(pose.disk_R, pose.disk_r, body.holes, pose.hole, pose.toward_base, pose.length)
    friction.z[:] = 0.0
    friction.distal[:] = distal_lengths(pose.length)
    straight = pose.length.sum(axis=0)
    springs = springs.at(heat.ambient[0])
    tension, weight_before, kept, at = GF * springs.force, 0.0, [], springs.elongation
    for row in range(len(heat.dt)):
        hot = springs.stepped(heat.current[row - 1], heat.ambient[row - 1], heat.dt[row]) if row else springs
        done, part = 0.0, 1.0
        while done < 1.0:
            part = min(part, 1.0 - done)
            share = done + part
            now = springs.at(springs.temperature + share * (hot.temperature - springs.temperature))
            weight = weight_before + share * (heat.weight[row] - weight_before)
            soft = body._replace(compliance=body.compliance * heat.softness[row])
            u_old, T_old, e = u.copy(), tension.copy(), at
            agreed = False
            for _ in range(TRIES):
                s, k = now.tangent(e)
                # e = 9 mm + length - straight - stretch T = e_now + (T - s) / k, all in m and N
                step = load._replace(
                    disk_force=weight * load.disk_force,
                    line_force=weight * load.line_force,
                    free_length=straight + 1e-3 * (e - FIRST_ELONGATION - s / k),
                    stretch=stretch + 1e-3 / (GF * k),
                    by_length=True,
                )
                if not equilibrium(u, tension, mesh, soft, step, friction, pose):
                    break
                e = FIRST_ELONGATION + 1e3 * (pose.length.sum(axis=0) - straight - stretch * tension)
                agreed = bool(np.abs(np.maximum(now.pull(e), 0.0) - tension / GF).max() < AGREED)
                if agreed:
                    break
            if not agreed:
                u[:], tension[:] = u_old, T_old
                part *= 0.5
                if part < SMALLEST:
                    raise NoEquilibrium(f"row {row} of {len(heat.dt)}: springs at {now.temperature} degC do not settle")
                continue
            _commit(friction, pose)
            at = e
            done += part
            part *= 2.0
        springs = hot.rested(at)
        weight_before = heat.weight[row]
        if record.keep[row]:
            n = len(kept)
            record.disk_r[n], record.disk_R[n] = pose.disk_r, pose.disk_R
            record.length[n] = pose.length.sum(axis=0)
            record.tension[n] = tension * pose.ratio
            record.curvature[n], record.moment[n] = u, pose.moment
            kept.append(springs.temperature)
    return np.array(kept)
