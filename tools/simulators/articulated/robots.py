"""Describes planar robots: a chain of hinges in the vertical plane (x, z), springs, tendons, winches and servos.

SI throughout: m, kg, s, N, rad. The base frame has its origin in the first joint and x along the straight robot. An angle counts
from straight, each from the link before it; the world angle of link k is sense (q_1 + ... + q_k), from x towards z.
A built robot is the described one with every uncertain number moved by its tolerance times a standard normal number, cut at two.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

BASE = -1  # the link a via point is on when it does not move
CUT = 2.0  # standard deviations beyond which a part is not delivered


@dataclass(frozen=True)
class Link:
    """A rigid body from one hinge to the next; its centre of mass lies on the line between them, `com` from its own hinge."""

    name: str
    length: float
    mass: float
    com: float
    inertia: float  # kg m^2 about the hinge direction at the centre of mass


@dataclass(frozen=True)
class Joint:
    """A hinge with spring, damping and rotor. `load` (N m) and `reach` (rad) are what a day's torques and angles come to."""

    name: str
    stiffness: float
    rest: float
    damping: float
    armature: float
    low: float
    high: float
    start: float  # where it is let go before a log
    load: float
    reach: float


@dataclass(frozen=True)
class Via:
    """A point on a link through which a tendon runs; the last of a tendon holds its end."""

    name: str
    tendon: str
    link: int
    x: float
    z: float


@dataclass(frozen=True)
class Drive:
    """What follows one command; `home` is the command before a log, `peak` (N or N m) what a day asks of it."""

    name: str
    target: str  # the tendon or the joint
    kp: float
    kv: float
    limit: float
    home: float
    peak: float


@dataclass(frozen=True)
class Winch(Drive):
    """Pulls its tendon: T = kp (length - command) + kv d(length)/dt, from 0 to `limit`."""


@dataclass(frozen=True)
class Servo(Drive):
    """Turns its joint: torque = kp (command - q) - kv dq/dt, within `limit` either way."""


@dataclass(frozen=True)
class Move:
    """A direction in the space of commands (m, rad), run through from `low` to 1 times `by`."""

    name: str
    by: tuple[float, ...]
    low: float


@dataclass(frozen=True)
class Instrument:
    """White noise of standard deviation `sigma`, read in steps of `step`, both in `unit`; `scale` is units per SI unit."""

    unit: str
    scale: float
    sigma: float
    step: float


@dataclass(frozen=True)
class Robot:
    """A robot as described, how a day moves it and what it logs."""

    name: str
    title: str
    sense: float  # +1: positive angles turn x towards z
    gravity: tuple[float, float]
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    vias: tuple[Via, ...]
    drives: tuple[Drive, ...]
    stop: tuple[float, float]  # N m/rad and N m s/rad of every joint stop
    tip: str
    moves: tuple[Move, ...]
    payloads: tuple[float, float, float]  # kg in two measured trials and one held out
    encoders: tuple[str, ...]
    instruments: dict[str, Instrument]
    rates: tuple[int, ...]  # Hz, of which a session takes one
    force: str  # how a winch's pull is logged: tension or force

    @property
    def winches(self) -> tuple[Drive, ...]:
        """The drives that pull tendons."""
        return tuple(d for d in self.drives if isinstance(d, Winch))

    @property
    def servos(self) -> tuple[Drive, ...]:
        """The drives that turn joints."""
        return tuple(d for d in self.drives if isinstance(d, Servo))

    def joint(self, name: str) -> int:
        """Return the number of a joint."""
        return [j.name for j in self.joints].index(name)


@dataclass(frozen=True)
class Tolerance:
    """One uncertain number: `std` is relative or in m, `key` its name in robot.toml, `axis` its component if any."""

    key: str
    group: str
    index: int
    field: str
    std: float
    relative: bool = True
    axis: int | None = None

    def moved(self, robot: Robot, deviations: float) -> Robot:
        """Return the robot with this number moved by so many standard deviations."""
        items = list(getattr(robot, self.group))
        value = getattr(items[self.index], self.field)
        moved = value * (1.0 + self.std * deviations) if self.relative else value + self.std * deviations
        items[self.index] = replace(items[self.index], **{self.field: moved})
        return replace(robot, **{self.group: tuple(items)})


def tolerances(robot: Robot) -> list[Tolerance]:
    """List every uncertain number of a robot, always in the same order."""
    found: list[Tolerance] = []
    ends = [f"body.{link.name}.pos" for link in robot.links[1:]] + [f"site.{robot.tip}.pos"]
    for i, link in enumerate(robot.links):
        found.append(Tolerance(f"body.{link.name}.mass", "links", i, "mass", 0.03))
        found.append(Tolerance(f"body.{link.name}.inertia", "links", i, "inertia", 0.05))
        found.append(Tolerance(ends[i], "links", i, "length", 0.002, axis=0))
    for i, joint in enumerate(robot.joints):
        for name, std in (("stiffness", 0.05), ("damping", 0.3), ("armature", 0.3)):
            if getattr(joint, name) > 0.0:
                found.append(Tolerance(f"joint.{joint.name}.{name}", "joints", i, name, std))
    for i, drive in enumerate(robot.drives):
        found.append(Tolerance(f"actuator.{drive.name}.kp", "drives", i, "kp", 0.05))
        found.append(Tolerance(f"actuator.{drive.name}.kv", "drives", i, "kv", 0.3))
    for i, via in enumerate(robot.vias):
        found.append(Tolerance(f"site.{via.name}.pos", "vias", i, "x", 2e-4, False, 0))
        found.append(Tolerance(f"site.{via.name}.pos", "vias", i, "z", 2e-4, False, 2))
    return found


def built(robot: Robot, deviations: np.ndarray) -> Robot:
    """Return the robot with every uncertain number moved by so many standard deviations."""
    for tolerance, u in zip(tolerances(robot), deviations, strict=True):
        robot = tolerance.moved(robot, float(u))
    return robot


def delivered(robot: Robot, rng: np.random.Generator) -> np.ndarray:
    """Draw how far each uncertain number of a delivered robot is from its description, in standard deviations."""
    return np.clip(rng.normal(size=len(tolerances(robot))), -CUT, CUT)


def _vias(tendon: str, points: tuple[tuple[int, float, float], ...]) -> tuple[Via, ...]:
    """Points (link, x mm, z mm) from the winch to the end."""
    return tuple(Via(f"{tendon}_{k}", tendon, link, 1e-3 * x, 1e-3 * z) for k, (link, x, z) in enumerate(points, 1))


def _instruments(motor: tuple[float, float], pull: float, torque: float, tip: float) -> dict[str, Instrument]:
    """Instruments by kind: a motor's noise and step (mm), noise of a pull (N), of a torque (N m), of the camera (mm)."""
    return {
        "motor": Instrument("mm", 1e3, *motor),
        "tension": Instrument("N", 1.0, pull, 0.001),
        "angle": Instrument("deg", 180.0 / np.pi, 0.05, 0.05),
        "torque": Instrument("N*m", 1.0, torque, 0.001),
        "tip": Instrument("mm", 1e3, tip, 0.001),
    }


def tendon_finger() -> Robot:
    """Return a finger of three joints with return springs, pulled by three winches."""
    rad = np.deg2rad
    back = [(BASE, -40, 9), (BASE, -2.5, 7), (0, 2.5, 7), (0, 43, 5.5), (1, 2, 5.5), (1, 28.5, 3.8), (2, 1.5, 3.8)]
    palm = [(BASE, -40, -9), (BASE, -10.5, -7), (0, 10.5, -7), (0, 36.5, -5.5), (1, 8.5, -5.5), (1, 23.5, -4.5), (2, 6.5, -4.5)]
    short = [(BASE, -40, -12), (BASE, -13, -9), (0, 13, -9)]
    joints = [("mcp", 0.12, 15, 1.6e-3, 0.05, 56), ("pip", 0.08, 25, 7e-4, 0.03, 58), ("dip", 0.05, 20, 2.5e-4, 0.015, 66)]
    return Robot(
        name="tendon_finger", title="Three-joint finger, three winch-driven tendons", sense=-1.0, gravity=(0.0, -9.81),
        links=(
            Link("proximal", 0.045, 0.025, 0.0225, 4.7e-6),
            Link("middle", 0.030, 0.015, 0.015, 1.3e-6),
            Link("distal", 0.022, 0.008, 0.0105, 4e-7),
        ),
        joints=tuple(Joint(n, k, rad(r), d, 0.0, rad(-10), rad(100), rad(r), load, rad(far)) for n, k, r, d, load, far in joints),
        vias=_vias("flexor", tuple(palm)) + _vias("extensor", tuple(back)) + _vias("short_flexor", tuple(short)),
        drives=(
            Winch("flexor_winch", "flexor", 2000.0, 6.0, 30.0, 0.113593, 6.5),
            Winch("extensor_winch", "extensor", 1500.0, 5.0, 30.0, 0.120314, 9.0),
            Winch("short_flexor_winch", "short_flexor", 2500.0, 8.0, 30.0, 0.049394, 5.0),
        ),
        stop=(15.0, 0.01), tip="fingertip",
        moves=(
            Move("flex", (-0.0185, 0.0119, -0.0079), 0.0), Move("flexor", (-0.0065, 0.0, 0.0), 0.0),
            Move("extensor", (0.0, 0.003, 0.0), -1.0), Move("short", (-0.0042, 0.0027, -0.007), 0.0),
            Move("cocontraction", (-0.0035, -0.0025, -0.001), 0.0),
        ),
        payloads=(0.020, 0.010, 0.015), encoders=("mcp", "pip"), instruments=_instruments((0.01, 0.005), 0.02, 0.02, 0.2),
        rates=(50, 100, 100, 100, 100, 200), force="tension",
    )  # fmt: skip


def servo_arm() -> Robot:
    """Return an arm of two links, each turned by a geared servo."""
    end = np.deg2rad(120)
    return Robot(
        name="servo_arm", title="Two-link arm with geared position servos", sense=1.0, gravity=(0.0, -9.81),
        links=(Link("upper_link", 0.25, 0.40, 0.12, 2.4e-3), Link("fore_link", 0.20, 0.25, 0.10, 9e-4)),
        joints=(
            Joint("shoulder", 0.0, 0.0, 0.10, 0.012, -end, end, -0.5, 1.5, np.deg2rad(15)),
            Joint("elbow", 0.0, 0.0, 0.05, 0.005, -end, end, 0.7, 0.4, np.deg2rad(98)),
        ),
        vias=(),
        drives=(
            Servo("shoulder_servo", "shoulder", 40.0, 1.6, 5.0, -0.5, 5.0),
            Servo("elbow_servo", "elbow", 15.0, 0.45, 2.5, 0.7, 2.5),
        ),
        stop=(400.0, 1.0), tip="fingertip",
        moves=(Move("shoulder", (0.8, 0.0), -1.0), Move("elbow", (0.0, 0.9), -1.0), Move("both", (0.55, 0.65), -1.0)),
        payloads=(0.100, 0.050, 0.080), encoders=("shoulder", "elbow"), instruments=_instruments((0.01, 0.005), 0.02, 0.02, 0.2),
        rates=(50, 100, 100, 100, 100, 200), force="tension",
    )  # fmt: skip


def leg() -> Robot:
    """Return a hanging leg: x points down; a hip servo, a knee that one tendon flexes against a spring, an ankle on a spring."""
    rad = np.deg2rad
    return Robot(
        name="leg", title="Hanging leg: hip servo, knee tendon against a spring, passive ankle", sense=-1.0, gravity=(9.81, 0.0),
        links=(
            Link("thigh", 0.20, 0.80, 0.09, 2.7e-3), Link("shank", 0.18, 0.40, 0.08, 1.1e-3), Link("foot", 0.15, 0.20, 0.06, 4e-4),
        ),
        joints=(
            Joint("hip", 0.0, 0.0, 0.15, 0.02, rad(-80), rad(80), 0.1, 1.5, rad(33)),
            Joint("knee", 1.2, rad(10), 0.12, 0.0, rad(-10), rad(120), rad(43), 0.8, rad(92)),
            Joint("ankle", 1.0, rad(-10), 0.05, 0.0, rad(-90), rad(90), rad(-14), 0.15, rad(20)),
        ),
        vias=_vias("knee_tendon", ((BASE, -60, -15), (BASE, -20, -12), (0, 25, -14), (0, 165, -26), (1, 30, -24), (1, 60, -18))),
        drives=(
            Servo("hip_servo", "hip", 60.0, 2.5, 12.0, 0.1, 12.0),
            Winch("knee_winch", "knee_tendon", 8000.0, 400.0, 150.0, 0.2930, 150.0),
        ),
        stop=(400.0, 1.0), tip="toe",
        moves=(Move("hip", (0.5, 0.0), -1.0), Move("knee", (0.0, -0.030), 0.0), Move("step", (0.35, -0.022), 0.0)),
        payloads=(0.100, 0.050, 0.080), encoders=("hip", "knee", "ankle"), instruments=_instruments((0.02, 0.01), 0.2, 0.05, 0.3),
        rates=(100,), force="force",
    )  # fmt: skip


ROBOTS = {"tendon_finger": tendon_finger, "servo_arm": servo_arm, "leg": leg}
