"""From a seed to a finger's measurement set on disk; the same arguments give the same bytes."""

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from tools.simulators.finger.bench import Log, make_finger, run
from tools.simulators.finger.camera import Points, cloud, scatter
from tools.simulators.finger.effects import Effect, all_effects
from tools.simulators.finger.mechanics.cables import interpolation
from tools.simulators.finger.mechanics.hand import Hand
from tools.simulators.finger.mechanics.shape import write_shape_truth
from tools.simulators.finger.mechanics.statics import Finger
from tools.simulators.finger.motions import bench_day, shape_day
from tools.simulators.finger.sensors import Built
from tools.simulators.finger.write import CLOUD, MARKER, SENSOR, Sheet, drive_reading, peaks, write_set

TABLES = Path(__file__).parent


def make_set(
    folder: Path,
    names: Sequence[str],
    seed: int,
    shape: bool = False,
    progress: Callable[[str], None] = lambda what: None,
    edges: bool = False,
) -> list[Effect]:
    """Write one day: folder/measured, folder/holdout, folder/truth.json; a shape day has folder/shape_truth.npz for its holdout.
    `edges`: in its tests two edges hold the finger, in place of a hand that pushes."""
    # Streams of their own, so that adding an effect changes neither finger nor day.
    making, motions, hands, instruments, laws = (np.random.default_rng([seed, n]) for n in range(5))
    built = Built.draw(making)
    effects = [all_effects()[name].draw(laws, built) for name in names]
    finger = make_finger(built, effects)
    trials = shape_day(motions) if shape else bench_day(motions)
    trials = [replace(t, edges=edges and t.hand and t.name.startswith("test")) for t in trials]
    pushing = {t.name: Hand.hold if t.edges else Hand.draw for t in trials if t.hand}
    pushes = {t.name: pushing[t.name](hands, finger.skin, float(t.time[-1])) for t in trials if t.hand}
    logs = run(finger, effects, trials, pushes, progress)
    sheets = _sheets(instruments, finger, built, effects, logs, markers=not shape)
    folder.mkdir(parents=True)
    kind = "shape" if shape else "bench"
    for part, held in (("measured", False), ("holdout", True)):
        chosen = [sheet for sheet in sheets if sheet.trial.heldout == held]
        if chosen:
            write_set(folder / part, f"Virtual finger {kind} {seed}", chosen)
    if shape:
        write_shape_truth(folder / "shape_truth.npz", TABLES / "points.csv", finger, built, logs)
    _write_truth(folder / "truth.json", seed, finger, built, effects, logs)
    return effects


def _sheets(
    rng: np.random.Generator, finger: Finger, built: Built, effects: Sequence[Effect], logs: Sequence[Log], markers: bool
) -> list[Sheet]:
    clock = np.concatenate([log.trial.start + log.trial.time for log in logs])
    strain = np.concatenate([log.strain for log in logs])
    for effect in effects:
        strain = effect.stretch(clock, strain)
    resistance = built.resistance(strain)
    for effect in effects:
        resistance = effect.read(clock, resistance, built)
    ends = np.cumsum([len(log.u) for log in logs])[:-1]
    table = np.genfromtxt(TABLES / "markers.csv", delimiter=",", skip_header=1, usecols=(1, 2, 3, 4))
    spots = Points.on_mantle(finger.body, np.deg2rad(table[:, 3]), table[:, 2])
    skin, turn = scatter(rng, finger.body), built.turn()
    sheets = []
    for log, values in zip(logs, np.split(resistance, ends), strict=True):
        trial = log.trial
        frames = np.arange(0.0, trial.time[-1] + 1e-9, trial.frames) if trial.cloud else np.zeros(0)
        at = np.searchsorted(trial.time, frames - 1e-9)
        seen = None
        if markers:
            pairs = [spots.seen(u, turn) for u in log.u]
            seen = np.array([np.where(visible[:, None], x, np.nan) for x, visible in pairs])
            seen = seen + MARKER * rng.normal(size=seen.shape)
        clouds = [cloud(rng, skin, log.u[n], turn, CLOUD) for n in at]
        values = values + SENSOR * rng.normal(size=values.shape)
        sheets.append(Sheet(trial, drive_reading(rng, trial.command), values, seen, clouds, trial.time[at]))
    return sheets


def _write_truth(path: Path, seed: int, finger: Finger, built: Built, effects: Sequence[Effect], logs: Sequence[Log]) -> None:
    ends = np.array([[0, 0, 95.0], [0, 0, 100.0]])
    weights = interpolation(finger.body, ends)
    truth = {
        "effects": {effect.id: effect.truth() for effect in effects},
        "in_catalogue": {effect.id: effect.in_catalogue for effect in effects},
        "seed": seed,
        "finger": asdict(built),
        "noise": {"sensor_ohm": SENSOR, "marker_mm": MARKER, "cloud_mm": CLOUD},
        "peak": {log.trial.name: peaks(log, ends + weights @ log.u) for log in logs},
        "newton_failures": sum(log.failures for log in logs),
    }
    path.write_text(json.dumps(truth, indent=1) + "\n")
