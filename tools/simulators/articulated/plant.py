"""Turns a robot's description into the arrays that the equations of motion read; what a described robot has not is zero there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tools.simulators.articulated.robots import Robot, Winch


class Chain(NamedTuple):
    """Links and hinges, one entry each; `drag` (N m s^2/rad^2) resists with the square of the speed."""

    sense: float
    gravity: np.ndarray  # (2,) m/s^2
    length: np.ndarray
    mass: np.ndarray
    com: np.ndarray
    inertia: np.ndarray
    armature: np.ndarray
    stiffness: np.ndarray
    rest: np.ndarray
    damping: np.ndarray
    drag: np.ndarray
    low: np.ndarray
    high: np.ndarray
    stop: np.ndarray  # (2,)


class Servos(NamedTuple):
    """Servos by joint; no gains where there is none. `gain` is the fraction delivered."""

    kp: np.ndarray
    kv: np.ndarray
    limit: np.ndarray
    gain: np.ndarray


class Tendons(NamedTuple):
    """Tendons with their winches; via points of all in one row, tendon i from first[i] to first[i + 1]."""

    first: np.ndarray
    link: np.ndarray
    x: np.ndarray
    z: np.ndarray
    kp: np.ndarray
    kv: np.ndarray
    limit: np.ndarray
    gain: np.ndarray
    compliance: np.ndarray  # m/N between drum and robot
    mu: np.ndarray
    slip: float  # m over which a tendon comes from sticking to sliding


class Rubbing(NamedTuple):
    """What rubs and catches: joints one entry each; a brush at the tip (force N, edge z m, width m)."""

    coulomb: np.ndarray  # N m
    load: np.ndarray  # share of the drive's torque
    stribeck: np.ndarray  # more by this share at rest
    speed: float  # rad/s over which that fades
    give: float  # rad over which a joint comes from sticking to sliding
    detent: np.ndarray  # N m
    teeth: np.ndarray  # a turn
    phase: np.ndarray
    brush: np.ndarray  # (3,)
    brush_give: float  # m


class Commands(NamedTuple):
    """How a command reaches tendon or joint (-1 where not): offset, play (m, rad) and lag (s)."""

    tendon: np.ndarray
    joint: np.ndarray
    zero: np.ndarray
    play: np.ndarray
    lag: np.ndarray


class Plant(NamedTuple):
    """A robot to integrate; `delay` s is how late its outputs are logged."""

    chain: Chain
    servos: Servos
    tendons: Tendons
    rubbing: Rubbing
    commands: Commands
    delay: float


def with_mass_at_tip(chain: Chain, mass: float) -> Chain:
    """Return the chain with a point mass fixed to its tip, as the last link's mass, centre of mass and inertia."""
    m, c, i, end = chain.mass.copy(), chain.com.copy(), chain.inertia.copy(), chain.length[-1]
    i[-1] += m[-1] * mass / (m[-1] + mass) * (end - c[-1]) ** 2
    c[-1] = (m[-1] * c[-1] + mass * end) / (m[-1] + mass)
    m[-1] += mass
    return chain._replace(mass=m, com=c, inertia=i)


def _per_servo(robot: Robot, name: str) -> np.ndarray:
    found = np.zeros(len(robot.joints))
    for drive in robot.servos:
        found[robot.joint(drive.target)] = getattr(drive, name)
    return found


def _tendons(robot: Robot) -> Tendons:
    names, per = [w.target for w in robot.winches], len(robot.winches)
    vias = [via for name in names for via in robot.vias if via.tendon == name]
    first = np.cumsum([0, *(sum(v.tendon == name for v in vias) for name in names)])
    link = np.array([v.link for v in vias], dtype=np.int64)
    x, z = np.array([v.x for v in vias], dtype=float), np.array([v.z for v in vias], dtype=float)
    kp, kv, limit = (np.array([getattr(w, name) for w in robot.winches], dtype=float) for name in ("kp", "kv", "limit"))
    slip = 2e-3 * max(link.length for link in robot.links)
    return Tendons(first, link, x, z, kp, kv, limit, np.ones(per), np.zeros(per), np.zeros(per), slip)


def plant(robot: Robot, payload: float) -> Plant:
    """Return the arrays of a robot that carries a payload (kg) at its tip."""
    n, drives = len(robot.joints), robot.drives
    links = (np.array([getattr(link, name) for link in robot.links]) for name in ("length", "mass", "com", "inertia"))
    names = ("armature", "stiffness", "rest", "damping")
    joints = {name: np.array([getattr(j, name) for j in robot.joints]) for name in (*names, "low", "high")}
    chain = Chain(robot.sense, np.array(robot.gravity), *links, **joints, drag=np.zeros(n), stop=np.array(robot.stop))
    servos = Servos(_per_servo(robot, "kp"), _per_servo(robot, "kv"), _per_servo(robot, "limit"), np.ones(n))
    rubbing = Rubbing(
        np.zeros(n), np.zeros(n), np.zeros(n), 1.0, 1e-3, np.zeros(n), np.zeros(n), np.zeros(n), np.array([0.0, 0.0, 1.0]), 1e-3
    )
    tendon_of = [w.target for w in robot.winches]
    winds = [isinstance(d, Winch) for d in drives]
    tendon = np.array([tendon_of.index(d.target) if w else -1 for d, w in zip(drives, winds, strict=True)], dtype=np.int64)
    joint = np.array([-1 if w else robot.joint(d.target) for d, w in zip(drives, winds, strict=True)], dtype=np.int64)
    commands = Commands(tendon, joint, *(np.zeros(len(drives)) for _ in range(3)))
    return Plant(with_mass_at_tip(chain, payload), servos, _tendons(robot), rubbing, commands, 0.0)
