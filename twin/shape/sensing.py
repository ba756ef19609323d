"""Read the strain sensors of a trial: resistances without the sensors' effects, and the tendons' displacements.

Effects of the sensors that the twin has (drift, gain, hysteresis) are inverted: R is found such that the sensors would report what
they reported, by R <- R + (reported - sense(R)).
"""

from dataclasses import dataclass, replace

import numpy as np

from twin.body import Drive
from twin.body.strain_cords import Cords, strain
from twin.foundation.errors import DataError
from twin.measurements import Recording
from twin.measurements.recording import EXTERNAL_CONTACT
from twin.mechanics.silicone import SoftBody
from twin.prediction.prepared import Inputs, prepare
from twin.prediction.twin import Twin

INVERSION_ITERATIONS = 30  # fixed-point steps that invert the sensors' effects
OPEN_CIRCUIT_RATIO = 3.0  # times the resistance at rest, or that part of it: strains of a finger make no more than 1.6
# of the resistance at rest: a smaller range is noise, a range beyond the second is motion
DEAD_SENSOR_RANGE, LIVE_SENSOR_RANGE = 0.005, 0.03


@dataclass(frozen=True)
class SensedTrial:
    """One trial as its sensors read it.

    `time` (n,) s; `resistance` (n, s) ohm without the sensors' effects, NaN where a sensor is dead; `displacement` (n, t) m as the
    motors pull; `contact`: what may push, in the words of the set, None where nothing does.
    """

    name: str
    time: np.ndarray
    resistance: np.ndarray
    displacement: np.ndarray
    contact: str | None

    @property
    def pushed(self) -> bool:
        """Whether something may push in this trial."""
        return self.contact is not None

    def strain(self, cords: Cords) -> np.ndarray:
        """Return the strains (n, s) of the cords."""
        return strain(self.resistance, cords)


def sensing_finger(twin: Twin) -> SoftBody:
    """Return the body of a twin that is one soft finger with strain sensors. Raises DataError for any other robot."""
    body = twin.body()
    if "strain sensors" not in body.features:
        raise DataError(f"robot {twin.robot.name!r} has no strain sensors; shape is estimated for soft bodies that have them")
    return twin.robot.silicone(body)


def read_sensors(recording: Recording, twin: Twin) -> tuple[tuple[SensedTrial, ...], tuple[str, ...]]:
    """Read the sensors of all trials, in the order of the recording, and return notices for the reader.

    Raises DataError for a missing column of a sensor, a resistance that is not above zero, or tendons not driven by displacement.
    """
    body = sensing_finger(twin)
    channels = [f"sensor_{i + 1}_resistance" for i in range(len(body.cord_paths))]
    columns = {c.name for c in recording.channels}
    if missing := [c for c in channels if c not in columns]:
        raise DataError(
            f"{recording.title}: no column {', '.join(missing)}; a shape needs every sensor of robot {twin.robot.name!r}"
        )
    undisturbed = tuple(replace(t, other={}) for t in recording.trials)  # contacts do not matter here
    prepared = prepare(replace(recording, trials=undisturbed), twin.robot)
    if not prepared.driven_by(Drive.DISPLACEMENT).all():
        raise DataError(f"{recording.title}: tendons are not driven by displacement; give tendon_I_displacement the role 'input'")
    by_name, notices, readings = {t.name: t for t in recording.trials}, list(prepared.notices), {}
    for name, trial in by_name.items():
        values = np.stack([trial.values[c] for c in channels], axis=1)
        _refuse_nonpositive(name, channels, values)
        readings[name], found = _mask_dead_sensors(name, channels, values, body.cords.rest)
        notices += found
    if not any(np.isfinite(v).any() for v in readings.values()):
        raise DataError(f"{recording.title}: no resistance is near {body.cords.rest.round(1).tolist()} ohm; check unit and robot")
    contact = {name: str(t.other[EXTERNAL_CONTACT]) for name, t in by_name.items() if EXTERNAL_CONTACT in t.other}
    sensed = {i.name: _undo_sensor_effects(twin, body, i, readings[i.name], contact.get(i.name)) for i in prepared.inputs}
    return tuple(sensed[t.name] for t in recording.trials), tuple(notices)


def _refuse_nonpositive(name: str, channels: list[str], values: np.ndarray) -> None:
    """Raise DataError for a resistance that is not above zero."""
    rows, columns = np.nonzero(values <= 0.0)
    if len(rows):
        raise DataError(
            f"{name}, row {rows[0] + 1}: {channels[columns[0]]} is {values[rows[0], columns[0]]:g} ohm; resistances are above zero"
        )


def _mask_dead_sensors(name: str, channels: list[str], values: np.ndarray, rest: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """Return the readings (n, s) of one trial, NaN where a sensor is dead, and notices about these."""
    out, notices = values.copy(), []
    broken = (values > OPEN_CIRCUIT_RATIO * rest) | (values < rest / OPEN_CIRCUIT_RATIO)
    out[broken] = np.nan
    known = np.isfinite(out)
    span = np.array([np.ptp(v[k]) / r if k.any() else 0.0 for v, k, r in zip(out.T, known.T, rest, strict=True)])
    still = (span < DEAD_SENSOR_RANGE) & (np.median(span) > LIVE_SENSOR_RANGE)
    for i, channel in enumerate(channels):
        if broken[:, i].any():
            notices.append(
                f"{name}: {channel} is an open or short circuit in {int(broken[:, i].sum())} rows; the others are used there"
            )
        elif not known[:, i].any():
            notices.append(f"{name}: {channel} is empty; the others are used")
        elif still[i]:
            out[:, i] = np.nan
            notices.append(f"{name}: {channel} does not change while the others do: it is dead, and they are used")
    return out, notices


def _undo_sensor_effects(twin: Twin, body: SoftBody, inputs: Inputs, reported: np.ndarray, contact: str | None) -> SensedTrial:
    """Return one trial with the twin's sensor effects inverted."""
    chain = twin.effect_chain
    driven = chain.drive(chain.command(inputs.signals.with_changes(antagonists=body.antagonists)))
    known = np.where(np.isfinite(reported), reported, body.cords.rest)
    rest, resistance = np.broadcast_to(body.cords.rest, known.shape), known.copy()
    if any(e.acts_in("sense") for e in twin.effects):
        for _ in range(INVERSION_ITERATIONS):
            predicted = chain.sense(driven.with_changes(others={"sensor": resistance, "sensor_rest": rest})).group("sensor")[..., 0]
            resistance = np.maximum(resistance + known - predicted, 1e-3 * rest)
    resistance = np.where(np.isfinite(reported), resistance, np.nan)
    return SensedTrial(inputs.name, inputs.time, resistance, driven.command, contact)
