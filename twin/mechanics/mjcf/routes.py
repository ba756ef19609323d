"""Where tendons of an MJCF run: what winds them, which hinges they cross, and which way is out from those."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache

import mujoco
import numpy as np

from twin.body.drives.counts import Winch
from twin.mechanics.mjcf.loading import LoadedModel

LEAST_SINE = 0.1  # of the angle between a tendon and a hinge's axis: nearer to parallel it has no lever there
LEAST_ARM = 1e-6  # m: a tendon through the axis of a hinge has no side of it
SAME_PLACE = 9  # decimals of a metre: nearer than that, two distances are one
_W, _HINGE = mujoco.mjtWrap, int(mujoco.mjtJoint.mjJNT_HINGE)
_OVER_SITES = {int(_W.mjWRAP_SITE), int(_W.mjWRAP_PULLEY)}


@dataclass(frozen=True)
class _Crossing:
    """A hinge that a tendon crosses between two of its sites, numbered along it: unit direction away from the axis, arm (m)."""

    before: int
    anchor: np.ndarray
    out: np.ndarray
    arm: float


def winches_of(loaded: LoadedModel) -> tuple[Winch, ...]:
    """Return the actuators whose force pulls one spatial tendon and depends, if at all, on its length and rate alone."""
    model, names, found = loaded.model, loaded.names("tendon"), []
    for k in range(model.nu):
        t, gear = int(model.actuator_trnid[k, 0]), float(model.actuator_gear[k, 0])
        pulls = model.actuator_trntype[k] == int(mujoco.mjtTrn.mjTRN_TENDON) and gear != 0.0
        fixed = model.actuator_gaintype[k] == int(mujoco.mjtGain.mjGAIN_FIXED)
        affine = model.actuator_biastype[k] in (int(mujoco.mjtBias.mjBIAS_NONE), int(mujoco.mjtBias.mjBIAS_AFFINE))
        if pulls and fixed and affine and _is_spatial(model, t) and model.actuator_biasprm[k, 1] <= 0.0:
            found.append(Winch(names[t], k, gear))
    return tuple(found)


def geared(model: mujoco.MjModel) -> np.ndarray:
    """Return the torque on each joint (njnt, nu) per force of an actuator that turns it by itself, and so through its gear.

    What a tendon does to a joint, whether it is wound for that or only crosses it, goes through no gear.
    """
    on_joints = np.isin(model.actuator_trntype, (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)))
    own = np.flatnonzero(on_joints)
    torque = np.zeros((model.njnt, model.nu))
    torque[model.actuator_trnid[own, 0], own] = model.actuator_gear[own, 0]
    return torque


@lru_cache(maxsize=32)
def outward(loaded: LoadedModel) -> Mapping[str, np.ndarray]:
    """Return, by the name of each tendon that crosses a hinge, its sites' unit shifts (nsite, 3) away from the nearest such hinge.

    In the reference pose, in the frames of the sites' bodies: perpendicular to the tendon where it crosses the hinge, and to the
    hinge's axis. Left out are tendons that wrap around geoms, which set the lever there, and those of joints.
    """
    model, names = loaded.model, loaded.names("tendon")
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    found = {}
    for t in range(model.ntendon):
        shift = np.zeros((model.nsite, 3))
        for sites in _branches(model, t):
            crossings = [c for k in range(len(sites) - 1) for c in _crossings(model, data, (k, sites[k], sites[k + 1]))]
            along = np.cumsum([0.0, *np.linalg.norm(np.diff(data.site_xpos[sites], axis=0), axis=1)])
            for i, site in enumerate(sites if crossings else []):
                nearest = min(crossings, key=lambda c: _remoteness(c, along, i, data.site_xpos[site]))
                turn = data.xmat[model.site_bodyid[site]].reshape(3, 3)
                shift[site] = turn.T @ nearest.out
        if shift.any():
            found[names[t]] = shift
    return found


def _remoteness(c: _Crossing, along: np.ndarray, i: int, place: np.ndarray) -> tuple[float, float, float]:
    """Return how far a crossing is from a tendon's i-th site: along the tendon, then straight; of two alike the longer arm."""
    way = min(abs(along[i] - along[c.before]), abs(along[i] - along[c.before + 1]))
    return round(float(way), SAME_PLACE), round(float(np.linalg.norm(place - c.anchor)), SAME_PLACE), -c.arm


def _is_spatial(model: mujoco.MjModel, t: int) -> bool:
    return bool(model.wrap_type[model.tendon_adr[t]] != int(_W.mjWRAP_JOINT))


def _branches(model: mujoco.MjModel, t: int) -> list[list[int]]:
    """Return the sites of a tendon over sites alone, pulley by pulley; nothing of another."""
    wraps = range(model.tendon_adr[t], model.tendon_adr[t] + model.tendon_num[t])
    if not {int(model.wrap_type[w]) for w in wraps} <= _OVER_SITES:
        return []
    found: list[list[int]] = [[]]
    for w in wraps:
        if model.wrap_type[w] == int(_W.mjWRAP_PULLEY):
            found.append([])
        else:
            found[-1].append(int(model.wrap_objid[w]))
    return [sites for sites in found if sites]


def _crossings(model: mujoco.MjModel, data: mujoco.MjData, piece: tuple[int, int, int]) -> Iterator[_Crossing]:
    """Yield the hinges between two sites of a tendon, `piece` being (number of the first along it, site, next site)."""
    k, a, b = piece
    start, end = data.site_xpos[a], data.site_xpos[b]
    way = end - start
    length = float(np.linalg.norm(way))
    between = _ancestors(model, int(model.site_bodyid[a])) ^ _ancestors(model, int(model.site_bodyid[b]))
    for j in (j for j in range(model.njnt) if model.jnt_bodyid[j] in between and model.jnt_type[j] == _HINGE and length > 0.0):
        across = np.cross(data.xaxis[j], way / length)
        sine = float(np.linalg.norm(across))
        if sine < LEAST_SINE:
            continue
        arm = float((start - data.xanchor[j]) @ across) / sine
        if abs(arm) > LEAST_ARM:
            yield _Crossing(k, data.xanchor[j].copy(), np.sign(arm) * across / sine, abs(arm))


def _ancestors(model: mujoco.MjModel, body: int) -> set[int]:
    found = set[int]()
    while body > 0:
        found.add(body)
        body = int(model.body_parentid[body])
    return found
