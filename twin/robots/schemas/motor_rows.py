"""Rows of the motors that wind a robot's tendons, and of the tendons' pretension and stretch; what a structure says of motors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from twin.body import Drive, Port, Sense
from twin.body.drives.drive_train import DriveTrain
from twin.foundation.parameters import parameter_array
from twin.robots.schema import FULL_TURN, Row, Structure

MOTORISED = frozenset({"motors"})
MOST_TURNS = 100.0  # of a motor from its zero

MOTOR_ROWS = (
    Row(
        "motors.radius",
        "m",
        "mm",
        "radius of each motor's spool, to the middle of the tendon",
        1e-5,
        1.0,
        ("motor",),
        for_kinds=MOTORISED,
    ),
    Row(
        "motors.gear",
        "1",
        "1",
        "turns of the logged angle for one turn of the spool",
        1e-3,
        1e5,
        ("motor",),
        for_kinds=MOTORISED,
        default=1.0,
    ),
    Row(
        "motors.zero",
        "rad",
        "deg",
        "logged angle at which the motor's tendons have their pretension on the straight robot",
        -MOST_TURNS * FULL_TURN,
        MOST_TURNS * FULL_TURN,
        ("motor",),
        for_kinds=MOTORISED,
        default=0.0,
    ),
    Row(
        "motors.torque_constant",
        "N*m/A",
        "N*m/A",
        "torque at the logged angle's shaft for an ampere; needed where currents are logged",
        1e-6,
        1e3,
        ("motor",),
        for_kinds=MOTORISED,
        group="motors",
    ),
    Row("tendons.pretension", "N", "N", "tension at zero displacement on the straight robot", 0.0, 1e4, ("tendon",), default=0.0),
    Row(
        "tendons.stretch",
        "m/N",
        "mm/N",
        "elongation of a tendon for a newton: line, mount and springs in series",
        0.0,
        0.1,
        default=0.0,
    ),
)

Wound = Annotated[list[Annotated[int, Field(ge=-24, le=24)]], Field(min_length=1, max_length=24)]


class Motorised(Structure):
    """The key of a [structure] that says which motor winds which tendons."""

    motors: list[Wound] | None = Field(
        None,
        description="of each motor the tendons that it winds: of [[1, -2], [3]] one pulls tendon 1 in and lets 2 go as its angle "
        "grows, the other pulls tendon 3 in",
    )

    def motor_kinds(self) -> frozenset[str]:
        """Return the kind of a robot with motors, for `Row.for_kinds`."""
        return MOTORISED if self.motors else frozenset()

    def motor_problems(self, n_tendon: int) -> list[str]:
        """Return what is wrong with the list of motors of a robot of this many tendons."""
        wound = [abs(t) for motor in self.motors or [] for t in motor]
        if not wound or (sorted(wound) == sorted(set(wound)) and min(wound) >= 1 and max(wound) <= n_tendon):
            return []
        return [f"structure: motors is {self.motors}; each motor winds tendons from 1 to {n_tendon}, a tendon has one motor"]


def motor_conflicts(values: Mapping[str, float]) -> list[str]:
    """Return the contradictions between the numbers of a robot's drives (SI, by name)."""
    pretension = any(v > 0.0 for name, v in values.items() if name.startswith("tendons.pretension"))
    if pretension and not values.get("tendons.stretch", 0.0) > 0.0:
        return ["tendons.pretension is above 0 and tendons.stretch is 0; a tendon that gives holds a pretension: write its stretch"]
    return []


def _winding(motors: Sequence[Sequence[int]], values: Mapping[str, float], n_tendon: int) -> np.ndarray:
    """Return (n_motor, n_tendon) m/rad by which a motor's angle pulls each tendon in."""
    out = np.zeros((len(motors), n_tendon))
    if not motors:
        return out
    reach = parameter_array(values, "motors.radius", len(motors)) / parameter_array(values, "motors.gear", len(motors))
    for i, tendons in enumerate(motors):
        for t in tendons:
            out[i, abs(t) - 1] = np.copysign(reach[i], t)
    return out


def drive_train(
    motors: Sequence[Sequence[int]], n_tendon: int, values: Mapping[str, float], described: Mapping[str, float]
) -> DriveTrain:
    """Return the drive train of a robot at these values (SI, by name), whose commands are made with the described ones."""
    built, said = (_winding(motors, v, n_tendon) for v in (values, described))
    wound = np.abs(said).sum(axis=0) > 0.0
    share = np.where(wound, np.abs(built).sum(axis=0) / np.where(wound, np.abs(said).sum(axis=0), 1.0), 1.0)
    shift = values.get("tendons.stretch", 0.0) * parameter_array(values, "tendons.pretension", n_tendon)
    if motors:
        shift = shift - parameter_array(values, "motors.zero", len(motors)) @ built
    return DriveTrain(built, share, shift, values.get("tendons.stretch", 0.0), _torque_constants(len(motors), values))


def _torque_constants(n_motor: int, values: Mapping[str, float]) -> np.ndarray:
    """Return (n_motor,) N m/A, NaN where the robot does not say."""
    said = any(name.startswith("motors.torque_constant") for name in values)
    return parameter_array(values, "motors.torque_constant", n_motor) if said else np.full(n_motor, np.nan)


def motor_ports(motors: Sequence[Sequence[int]], values: Mapping[str, float], n_tendon: int) -> dict[int, tuple[Port, ...]]:
    """Return further ports of tendons (from 0): the angle of the motor that winds them; its torque or current if it winds one."""
    winding, found = _winding(motors, values, n_tendon), {}
    for i, tendons in enumerate(motors):
        per_ampere = _torque_constants(len(motors), values)[i]
        for t in (abs(t) - 1 for t in tendons):
            one, w = np.eye(n_tendon)[t], winding[i, t]
            ports = [Port(f"motor_{i + 1}_angle", Drive.DISPLACEMENT, tuple(w * one))]
            if len(tendons) == 1:
                ports.append(Port(f"motor_{i + 1}_torque", Drive.TENSION, tuple(one / w)))
                if np.isfinite(per_ampere):
                    ports.append(Port(f"motor_{i + 1}_current", Drive.TENSION, tuple(per_ampere * one / w)))
            found[t] = tuple(ports)
    return found


def motor_senses(n_motor: int, values: Mapping[str, float]) -> dict[str, Sense]:
    """Return the channels that motors can show."""
    kinds = ("angle", "torque", *(("current",) if np.isfinite(_torque_constants(n_motor, values)).any() else ()))
    return {f"motor_{i}_{kind}": Sense(f"motor {kind}", i - 1) for i in range(1, n_motor + 1) for kind in kinds}
