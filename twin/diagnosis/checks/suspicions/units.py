"""Units: readings, commands and payloads that would fit in another unit than the file declares."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from twin.diagnosis.checks.suspicions.case import Case, Suspicion, called, rms
from twin.diagnosis.thresholds import LEFT_BY_FILE_CHANGE, UNIT_MISTAKE_RATIO
from twin.foundation.units import unit_scale
from twin.measurements import Channel
from twin.prediction.prepared import Inputs

CONFUSABLE_UNITS = {  # SI unit -> units that are mistaken for each other
    "m": ("m", "cm", "mm", "um"), "N": ("N", "mN", "kN"), "rad": ("rad", "deg"), "K": ("K", "degC", "degF"), "A": ("A", "mA"),
    "V": ("V", "mV"), "ohm": ("ohm", "mohm", "kohm"), "N*m": ("N*m", "N*mm"),
}  # fmt: skip
LEVELS = ("ohm",)  # quantities that are never near zero, and differ from robot to robot: their level shows a wrong unit
UNIT_SUSPICIONS = {
    "m": "length unit", "N": "force unit", "rad": "angle unit", "K": "temperature unit", "A": "current unit", "V": "voltage unit",
    "ohm": "resistance unit", "N*m": "torque unit",
}  # fmt: skip


def outputs(case: Case) -> Iterator[Suspicion]:
    """Yield groups of outputs that fit in another unit of their dimension: mm under m, degrees under rad, K under degC."""
    nominal = case.as_is()
    if nominal is None:
        return
    groups = dict.fromkeys((o.group, o.channel.unit) for o in case.prepared.outputs)
    for group, unit in groups:
        columns = [j for j, o in enumerate(case.prepared.outputs) if (o.group, o.channel.unit) == (group, unit)]
        channels = [case.prepared.outputs[j].channel for j in columns]
        si, before, found = channels[0].si_unit, case.error(columns, nominal), []
        for other in others(channels[0]):
            reread = _reread(case, columns, unit, other, si)
            after = reread.error(columns, nominal)
            left = reread.better(before, after, columns)
            if left is None and si in LEVELS and after < LEFT_BY_FILE_CHANGE * before:
                left = after / before if not 1.0 / UNIT_MISTAKE_RATIO < _level(case, columns) < UNIT_MISTAKE_RATIO else None
            if left is not None:
                found.append((left, other))
        if found:
            left, other = min(found)
            read, shown = (_typical(case, columns, y, unit) for y in (case.prepared.measured, case.predicted or ()))
            words = f"{called(channels)} are some {read:.3g} {unit}, and the robot as described shows {shown:.3g} {unit}"
            yield Suspicion(UNIT_SUSPICIONS[si], words, f'unit = "{other}" instead of "{unit}" for {called(channels)}', left, group)


def commands(case: Case) -> Iterator[Suspicion]:
    """Yield drives that fit in another unit: tensions, displacements, currents, angles.

    Larger values are tried only where the robot as described moves too little, smaller ones where it moves too much or has no
    equilibrium, and none where it moves as measured.
    """
    columns, nominal = case.columns(case.group), case.as_is()
    if case.error(columns, nominal) < LEFT_BY_FILE_CHANGE * case.motion(columns):
        return
    moves = rms(_centred(case, columns)) if nominal is not None else np.inf
    larger = moves < case.motion(columns)
    for unit in dict.fromkeys(c.unit for c in case.prepared.drivers):
        of = np.array([c.unit == unit for c in case.prepared.drivers])
        channels = [c for c in case.prepared.drivers if c.unit == unit]
        si, size = (
            channels[0].si_unit,
            rms(np.concatenate([i.command[:, of] for i in case.prepared.inputs])) / abs(case.prepared.pull[of][0]),
        )
        read = size / unit_scale(unit, si).without_offset().to_si(1.0)

        def scaled(i: Inputs, of: np.ndarray, factor: float) -> Inputs:
            return replace(i, command=i.command * np.where(of, factor, 1.0))

        ratios = {other: _ratio(other, unit, si) for other in others(channels[0])}
        if not ratios:  # shares of a control's range, rates: nobody writes these in another unit
            continue
        tried = [(o, lambda i, of=of, f=f: scaled(i, of, f)) for o, f in ratios.items() if (f > 1.0) == larger]
        words = f"with {called(channels)} of some {read:.3g} {unit} the robot as described would not move as measured"
        change = 'unit = "{}" ' + f'instead of "{unit}" for {called(channels)}'
        yield from best(case, UNIT_SUSPICIONS[si], words, change, tried)


def torques(case: Case) -> Iterator[Suspicion]:
    """Yield torques on the robot that fit in another unit."""
    loads = case.twin.robot.build().load_channels
    for channel in (c for c in case.prepared.recording.inputs() if loads.get(c.name) == "torque"):
        ratios = {o: _ratio(o, channel.unit, "N*m") for o in others(channel)}
        tried = [(o, lambda i, f=f: replace(i, loads=replace(i.loads, torque=f * i.loads.torque))) for o, f in ratios.items()]
        words = f"under {channel.name} in {channel.unit} the robot as described would not move as measured"
        yield from best(
            case, UNIT_SUSPICIONS["N*m"], words, 'unit = "{}" ' + f'instead of "{channel.unit}" for {channel.name}', tried
        )


def payloads(case: Case) -> Iterator[Suspicion]:
    """Yield grams for kilograms, or the reverse."""
    most = max(i.loads.payload for i in case.prepared.inputs)
    if most > 0.0:
        tried = [
            (f"{most * f:.3g} kg", lambda i, f=f: replace(i, loads=replace(i.loads, payload=f * i.loads.payload)))
            for f in (1e-3, 1e3)
        ]
        words = f"under a tip_payload of up to {most:.3g} kg the robot as described would not move as measured"
        yield from best(case, "payload unit", words, f"tip_payload of up to {{}} instead of {most:.3g} kg: g, or kg", tried)


def best(case: Case, kind: str, words: str, change: str, tried: list) -> Iterator[Suspicion]:
    """Yield the best of the changes (name, change of inputs), where one explains far more."""
    columns, few = case.columns(case.group), case.few()
    before, found = case.error(columns, case.as_is(), few), []
    if case.floor(columns) >= LEFT_BY_FILE_CHANGE * before:
        return
    for name, meant in tried:
        left = case.better(before, case.error(columns, case.again(meant), few), columns)
        if left is not None:
            found.append((left, name))
    if found:
        left, name = min(found)
        yield Suspicion(kind, words, change.format(name), left, case.group)


def others(channel: Channel) -> list[str]:
    """Return the units that are easily mistaken for the channel's."""
    own = channel.scale
    return [u for u in CONFUSABLE_UNITS.get(channel.si_unit, ()) if unit_scale(u, channel.si_unit) != own]


def _centred(case: Case, columns: list[int]) -> np.ndarray:
    """Return the predicted columns of the fitted trials about their means."""
    p = np.concatenate([(case.predicted or ())[k][:, columns] for k in case.trials])
    return p - p.mean(axis=0)


def _ratio(other: str, unit: str, si: str) -> float:
    return float(unit_scale(other, si).to_si(1.0) / unit_scale(unit, si).to_si(1.0))


def _reread(case: Case, columns: list[int], unit: str, other: str, si: str) -> Case:
    """Return the case with the numbers of these columns read in another unit."""
    declared, meant = unit_scale(unit, si), unit_scale(other, si)
    measured = [y.copy() for y in case.prepared.measured]
    for y in measured:
        y[:, columns] = meant.to_si((y[:, columns] - declared.offset) * declared.denominator / declared.numerator)
    return replace(case, prepared=replace(case.prepared, measured=tuple(measured)))


def _typical(case: Case, columns: list[int], values: object, unit: str) -> float:
    """Return the RMS of the columns of the fitted trials, in the file's unit."""
    scale = case.prepared.outputs[columns[0]].channel.scale
    y = np.concatenate([values[k][:, columns] for k in case.trials])  # type: ignore[index]
    return rms((y - scale.offset) * scale.denominator / scale.numerator)


def _level(case: Case, columns: list[int]) -> float:
    """Return the ratio of measured to predicted, each the median over the columns of the fitted trials."""
    read, shown = (np.concatenate([v[k][:, columns] for k in case.trials]) for v in (case.prepared.measured, case.predicted or ()))
    return float(np.nanmedian(np.abs(read)) / np.nanmedian(np.abs(shown)))
