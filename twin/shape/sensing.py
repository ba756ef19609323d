"""From a measured trial to what an estimator is given: strains behind the resistances, and the tendons' displacements.

Effects of the sensors that the twin has (drift, gain, hysteresis) are undone: R is sought such that what the sensors would report
of it is what they reported, by R <- R + (reported - sense(R)).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from twin.bench import Inputs, prepare
from twin.effects import Drive
from twin.errors import DataError
from twin.measurements import Recording
from twin.measurements.recording import CONTACT
from twin.sensors import Cords, strain
from twin.soft import SoftBody
from twin.twin import Twin

ROUNDS = 30
OPEN = 3.0  # times its resistance at rest, or that part of it: strains of a finger make no more than 1.6
FLAT, MOVING = 0.005, 0.03  # of the resistance at rest: noise is below the one, what moves is beyond the other


@dataclass(frozen=True)
class Sensed:
    """One trial: time (n,) s, resistance (n, s) ohm with the sensors' effects undone, NaN where a sensor is dead; displacement
    (n, t) m as the motors pull; what may push, in the words of the set, None where nothing does."""

    name: str
    time: np.ndarray
    resistance: np.ndarray
    displacement: np.ndarray
    contact: str | None

    @property
    def pushed(self) -> bool:
        return self.contact is not None

    def strain(self, cords: Cords) -> np.ndarray:
        return strain(self.resistance, cords)


def feeling(twin: Twin) -> SoftBody:
    """The finger of a twin. Raises DataError for a robot that feels no strain or is no single finger."""
    body = twin.body()
    if "strain sensors" not in body.parts:
        raise DataError(f"robot {twin.robot.name!r} feels no strain: shape is estimated for soft bodies with strain sensors")
    return twin.robot.silicone(body)


def sense(recording: Recording, twin: Twin) -> tuple[tuple[Sensed, ...], tuple[str, ...]]:
    """Trials in the order of the recording, and what a reader should know.

    Raises DataError for a missing column of a sensor, a resistance that is not above zero, or tendons not driven by displacement.
    """
    body = feeling(twin)
    channels = [f"sensor_{i + 1}_resistance" for i in range(len(body.cord_paths))]
    there = {c.name for c in recording.channels}
    if missing := [c for c in channels if c not in there]:
        raise DataError(
            f"{recording.title}: no column {', '.join(missing)}; a shape needs every sensor of robot {twin.robot.name!r}"
        )
    disturbed = tuple(replace(t, other={}) for t in recording.trials)  # who pushed is no matter here
    bench = prepare(replace(recording, trials=disturbed), twin.robot)
    if not bench.driven_by(Drive.DISPLACEMENT).all():
        raise DataError(f"{recording.title}: tendons are not driven by displacement; give tendon_I_displacement the role 'input'")
    by_name, notices, readings = {t.name: t for t in recording.trials}, list(bench.notices), {}
    for name, trial in by_name.items():
        values = np.stack([trial.values[c] for c in channels], axis=1)
        _check(name, channels, values)
        readings[name], said = _alive(name, channels, values, body.cords.rest)
        notices += said
    if not any(np.isfinite(v).any() for v in readings.values()):
        raise DataError(f"{recording.title}: no resistance is near {body.cords.rest.round(1).tolist()} ohm; check unit and robot")
    contact = {name: str(t.other[CONTACT]) for name, t in by_name.items() if CONTACT in t.other}
    sensed = {i.name: _trial(twin, body, i, readings[i.name], contact.get(i.name)) for i in bench.inputs}
    return tuple(sensed[t.name] for t in recording.trials), tuple(notices)


def _check(name: str, channels: list[str], values: np.ndarray) -> None:
    rows, columns = np.nonzero(values <= 0.0)
    if len(rows):
        raise DataError(
            f"{name}, row {rows[0] + 1}: {channels[columns[0]]} is {values[rows[0], columns[0]]:g} ohm; resistances are above zero"
        )


def _alive(name: str, channels: list[str], values: np.ndarray, rest: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """Readings (n, s) of one trial, NaN where a sensor says nothing, and what was found."""
    out, said = values.copy(), []
    broken = (values > OPEN * rest) | (values < rest / OPEN)
    out[broken] = np.nan
    known = np.isfinite(out)
    span = np.array([np.ptp(v[k]) / r if k.any() else 0.0 for v, k, r in zip(out.T, known.T, rest, strict=True)])
    still = (span < FLAT) & (np.median(span) > MOVING)
    for i, channel in enumerate(channels):
        if broken[:, i].any():
            said.append(
                f"{name}: {channel} is an open or short circuit in {int(broken[:, i].sum())} rows; the others are used there"
            )
        elif not known[:, i].any():
            said.append(f"{name}: {channel} is empty; the others are used")
        elif still[i]:
            out[:, i] = np.nan
            said.append(f"{name}: {channel} does not change while the others do: it is dead, and they are used")
    return out, said


def _trial(twin: Twin, body: SoftBody, inputs: Inputs, reported: np.ndarray, contact: str | None) -> Sensed:
    laws = twin.laws
    driven = laws.drive(laws.command(inputs.signals.with_(antagonists=body.antagonists)))
    known = np.where(np.isfinite(reported), reported, body.cords.rest)
    rest, R = np.broadcast_to(body.cords.rest, known.shape), known.copy()
    if any(e.acts_in("sense") for e in twin.effects):
        for _ in range(ROUNDS):
            seen = laws.sense(driven.with_(others={"sensor": R, "sensor_rest": rest})).group("sensor")[..., 0]
            R = np.maximum(R + known - seen, 1e-3 * rest)
    R = np.where(np.isfinite(reported), R, np.nan)
    return Sensed(inputs.name, inputs.time, R, driven.command, contact)
