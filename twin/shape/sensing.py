"""From a measured trial to what an estimator is given: strains behind the resistances, and the tendons' displacements.

Effects of the sensors that the twin has (drift, gain, hysteresis) are undone: R is sought such that what the sensors would report of
it is what they reported, by R <- R + (reported - sense(R)).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from twin.bench import Bench, Inputs, prepare
from twin.body import Body
from twin.effects import Drive
from twin.errors import DataError
from twin.measurements import Recording
from twin.sensors import Cords, strain
from twin.soft import SoftBody
from twin.twin import Twin

ROUNDS = 30
CONTACT = "external_contact"
OPEN = 10.0  # times its resistance at rest: an open circuit


@dataclass(frozen=True)
class Sensed:
    """One trial: time (n,) s, resistance (n, s) ohm with the sensors' effects undone, NaN where a sensor is dead; displacement
    (n, t) m as the motors pull; whether something may push."""

    name: str
    time: np.ndarray
    resistance: np.ndarray
    displacement: np.ndarray
    pushed: bool

    def strain(self, cords: Cords) -> np.ndarray:
        return strain(self.resistance, cords)


def sense(recording: Recording, twin: Twin) -> tuple[tuple[Sensed, ...], tuple[str, ...]]:
    """Trials in the order of the recording, and what a reader should know.

    Raises DataError for a missing column of a sensor, a resistance that is not above zero, or tendons not driven by displacement.
    """
    body = twin.body()
    if not isinstance(body, SoftBody) or not len(body.cord_paths):
        raise DataError(f"robot {twin.robot.name!r} feels no strain: shape is estimated for soft bodies with strain sensors")
    channels = [f"sensor_{i + 1}_resistance" for i in range(len(body.cord_paths))]
    there = {c.name for c in recording.channels}
    if missing := [c for c in channels if c not in there]:
        raise DataError(f"{recording.title}: no column {', '.join(missing)}; a shape needs every sensor of robot {twin.robot.name!r}")
    bench = prepare(recording, twin.robot)
    if not bench.driven_by(Drive.DISPLACEMENT).all():
        raise DataError(f"{recording.title}: tendons are not driven by displacement; give tendon_I_displacement the role 'input'")
    by_name = {t.name: t for t in recording.trials}
    columns = {n: np.stack([by_name[n].values[c] for c in channels], axis=1) for n in by_name}
    for name, values in columns.items():
        _check(name, channels, values)
    dead = _dead(channels, np.concatenate(list(columns.values())), body.cords.rest)
    sensed = {i.name: _trial(twin, body, i, columns[i.name], list(dead), CONTACT in by_name[i.name].other) for i in bench.inputs}
    return tuple(sensed[t.name] for t in recording.trials), (*_notices(bench), *dead.values())


def _check(name: str, channels: list[str], values: np.ndarray) -> None:
    rows, columns = np.nonzero(values <= 0.0)
    if len(rows):
        raise DataError(
            f"{name}, row {rows[0] + 1}: {channels[columns[0]]} is {values[rows[0], columns[0]]:g} ohm; resistances are above zero"
        )


def _notices(bench: Bench) -> list[str]:
    return [n for n in bench.notices if CONTACT not in n]


def _dead(channels: list[str], values: np.ndarray, rest: np.ndarray) -> dict[int, str]:
    """Sensors that say nothing, and why, by index."""
    out: dict[int, str] = {}
    span = np.array([np.ptp(v[np.isfinite(v)]) / r if np.isfinite(v).any() else 0.0 for v, r in zip(values.T, rest, strict=True)])
    for i, (channel, column) in enumerate(zip(channels, values.T, strict=True)):
        known = column[np.isfinite(column)]
        if not len(known):
            out[i] = f"{channel} is empty: the others are used"
        elif np.median(known) > OPEN * rest[i]:
            out[i] = f"{channel} reads {np.median(known):.3g} ohm, an open circuit: the others are used"
        elif span[i] < 0.05 * np.median(span):
            out[i] = f"{channel} does not change while others do, it is dead: the others are used"
    return out


def _trial(twin: Twin, body: Body, inputs: Inputs, reported: np.ndarray, dead: list[int], pushed: bool) -> Sensed:
    laws = twin.laws
    driven = laws.drive(laws.command(inputs.signals.with_(antagonists=body.antagonists)))
    assert isinstance(body, SoftBody)
    known = np.where(np.isfinite(reported), reported, body.cords.rest)
    rest, R = np.broadcast_to(body.cords.rest, known.shape), known.copy()
    if any(e.acts_in("sense") for e in twin.effects):
        for _ in range(ROUNDS):
            seen = laws.sense(driven.with_(others={"sensor": R, "sensor_rest": rest})).group("sensor")[..., 0]
            R = np.maximum(R + known - seen, 1e-3 * rest)
    R = np.where(np.isfinite(reported), R, np.nan)
    R[:, dead] = np.nan
    return Sensed(inputs.name, inputs.time, R, driven.command, pushed)
