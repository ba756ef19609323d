"""The variables that a residual can be plotted against."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from twin.body import Drive
from twin.prediction.prepared import PreparedRecording
from twin.report.plots.predictions import complete_markers

REST_RATE_SHARE = 0.1  # of the median rate: a tendon that moves less is neither pulled nor released


@dataclass(frozen=True)
class Variable:
    """A quantity of every sample of all trials, (n,), with its axis title.

    `branch` (-1, 0, 1) splits the two branches of a loop. `relevant` marks the samples to show, `selection` says which they are.
    """

    title: str
    values: np.ndarray
    branch: np.ndarray
    relevant: np.ndarray
    is_loop: bool = False
    selection: str = ""


def variables(prepared: PreparedRecording) -> Iterator[tuple[str, Variable]]:
    """Yield each variable with its kind, as named in `Effect.plot_against`."""
    inputs, n = prepared.inputs, prepared.n_sample
    factor = np.array([_factor(prepared, t) for t in range(prepared.n_tendon)])
    pull = np.concatenate([i.command for i in inputs]) * factor
    slope = np.concatenate([_smoothed_rates(i.time, i.command) for i in inputs]) * factor
    still = REST_RATE_SHARE * np.median(np.abs(slope), axis=0)
    away = np.concatenate([i.pull for i in inputs])
    strongest = np.argmax(away * np.abs(factor) if inputs[0].home is None else np.abs(away), axis=1)
    every, no = np.ones(n, bool), np.zeros(n)
    for t in range(prepared.n_tendon):
        side = np.where(np.abs(slope[:, t]) > still[t], np.sign(slope[:, t]), 0.0)
        title, rate, which = _pull_names(prepared, t)
        shown = strongest == t
        yield "loop", Variable(title, pull[:, t], side, shown, True, which)
        yield "tension", Variable(title, pull[:, t], no, shown, False, which)
        yield "rate", Variable(rate, slope[:, t], no, every)
    for kind, title, parts in (
        ("elapsed", "time in the trial (s)", [i.time - i.time[0] for i in inputs]),
        ("clock", "time since the first trial (min)", [i.clock / 60.0 for i in inputs]),
        ("payload", "tip payload (g)", [np.full(len(i.time), 1e3 * i.loads.hung) for i in inputs]),
        ("torque", "load torque (N m)", [np.broadcast_to(i.loads.torque, len(i.time)) for i in inputs]),
        ("temperature", "ambient temperature (K)", [i.temperature for i in inputs]),
    ):
        yield kind, Variable(title, np.concatenate(parts), no, every)
    for kind, title, values in _tip_variables(prepared):
        yield kind, Variable(title, values, no, every)


def _by_motor(prepared: PreparedRecording, t: int) -> bool:
    """Return whether the column that drives a tendon is a motor's."""
    return prepared.drives[t] is not Drive.CONTROL and prepared.pull[t] != 1.0


def _factor(prepared: PreparedRecording, t: int) -> float:
    """Return the factor from a tendon's command, SI, to what is shown: a motor's reading in the unit of its column."""
    if not _by_motor(prepared, t):
        return prepared.drives[t].display_unit[1]
    scale = prepared.drivers[t].unit_scale.without_offset()
    return float(scale.from_si(np.array([1.0 / prepared.pull[t]]))[0])


def _pull_names(prepared: PreparedRecording, t: int) -> tuple[str, str, str]:
    """Return the titles of a tendon's command and of its rate, and which samples are shown.

    A control or a motor goes by its column's name.
    """
    what, unit = prepared.drives[t], prepared.drives[t].display_unit[0]
    if what is Drive.CONTROL or _by_motor(prepared, t):
        driver = prepared.drivers[t]
        shown = driver.si_unit if what is Drive.CONTROL else driver.unit
        return f"{driver.name} ({shown})", f"rate of {driver.name} ({shown}/s)", f"in which {driver.name} moves most"
    return (
        f"{what} of tendon {t + 1} ({unit})",
        f"rate of tendon {t + 1}'s {what} ({unit}/s)",
        f"in which tendon {t + 1} pulls most",
    )


def _tip_variables(prepared: PreparedRecording) -> Iterator[tuple[str, str, np.ndarray]]:
    whole = complete_markers(prepared)
    if not whole:
        return
    name, columns = whole[-1]
    at = 1e3 * np.concatenate(prepared.measured)[:, columns]
    for a, axis in enumerate("xyz"):
        yield "position", f"measured {axis} of {name} (mm)", at[:, a]
    for angle in range(15, 360, 15):
        if angle % 90:
            c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
            yield "position", f"reach of {name} towards {angle}° from x (mm)", at[:, :2] @ [c, s]
    yield "azimuth", f"direction {name} is bent to (° from x)", np.degrees(np.arctan2(at[:, 1], at[:, 0]))
    yield "reach", f"distance of {name} from the z axis (mm)", np.hypot(at[:, 0], at[:, 1])


def _smoothed_rates(time: np.ndarray, command: np.ndarray) -> np.ndarray:
    """Return du/dt (n, n_tendon) in N/s or m/s, smoothed over five samples so that noise gives no direction."""
    if len(time) < 2:
        return np.zeros_like(command)
    padded = np.pad(command, ((2, 2), (0, 0)), mode="edge")
    smooth = sum(padded[k : k + len(time)] for k in range(5)) / 5.0
    return np.gradient(smooth, time, axis=0)
