"""Alignment of a twin to a built finger from partial clouds, without a label: mounting angle, R0 and kappa of every sensor.

1. Mounting angle: where nothing pushes, tendons of known length give the shape; it is turned until the clouds lie on it.
2. Shape under a hand: coordinates of the twin's deformation modes, frame by frame (`cloud_fit.py`).
3. Sensors: with both kinds of shapes the strains are known, and sqrt(R) = a + a kappa+ max(eps, 0) + a kappa- min(eps, 0), a =
   sqrt(R0), is linear in (a, a kappa+, a kappa-): least squares, robust, with the robot's priors.
4. Bands: how far each estimator is off behind those clouds tells how wide its band is to be under this hand (`band.py`).

Every step is smooth and small; `tools/shape_error.py` holds it against a black-box search over all numbers at once.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import fminbound

from twin.bench import prepare
from twin.errors import DataError
from twin.factory import named_points
from twin.measurements import Clouds, Recording
from twin.measurements.patches import side
from twin.quantities import Fitted
from twin.sensors import strain
from twin.shape.band import Bands, Behind, widened_by
from twin.shape.cloud_fit import BEYOND, CLOUD, CloudFit
from twin.shape.estimator import Felt, estimators
from twin.shape.modal import Network
from twin.shape.sensing import Sensed, feeling, sense
from twin.shape.sensor_fit import FREE, PUSHED, Known, fit_sensors
from twin.soft import SoftBody, SoftStatics
from twin.soft.skin import Skin, distances, facing
from twin.soft.statics import turned
from twin.threads import single_thread
from twin.twin import Twin, simulate

STEP = 1e-4  # m in z, of differences
ANGLE = 2e-4  # rad, to which the mounting angle is sought


@dataclass(frozen=True)
class Aligned:
    """The aligned twin, its fitted numbers with standard errors, and what they rest on: distances (m, root mean square) of the
    clouds from the visible skin before and after, samples by kind, and what the clouds could not fix; how wide bands are to be."""

    twin: Twin
    fitted: Mapping[str, Fitted]
    bands: Bands
    before: float
    after: float
    frames: int
    unfixed: tuple[str, ...]
    notices: tuple[str, ...]
    seconds: float


@dataclass(frozen=True)
class Shown:
    """A trial with clouds: what was sensed, the direction (3,) to the camera, and, for a trial without a push, the shapes
    (n, n_free, 3) m at its samples."""

    sensed: Sensed
    clouds: Clouds
    side: np.ndarray
    nodes: np.ndarray | None

    def frames(self) -> list[tuple[int, np.ndarray]]:
        """Samples next to each cloud, and its points."""
        at = np.abs(self.sensed.time[None] - self.clouds.time[:, None]).argmin(axis=1)
        o = self.clouds.offsets
        return [(int(i), self.clouds.points[o[f] : o[f + 1]]) for f, i in enumerate(at) if o[f + 1] > o[f]]


def align(recording: Recording, twin: Twin, progress: Callable[[str], None] = lambda words: None) -> Aligned:
    """The twin aligned to a recording that has clouds. Raises DataError where no trial has, or none is free of a hand."""
    with single_thread():
        return _align(recording, twin, progress)


def _align(recording: Recording, twin: Twin, progress: Callable[[str], None]) -> Aligned:
    begun = time.perf_counter()
    shown, notices = _shown(recording, twin)
    body = feeling(twin)
    skin = Skin.of(body)
    progress("turning the finger onto its clouds")
    before = _misfit(skin, shown, body.turn)
    angle, angle_std = _angle(skin, shown, twin)
    net = Network.of(twin.robot)
    fitted: dict[str, Fitted] = {"mounting.angle": Fitted(angle, angle_std, "rad")}
    statics = SoftStatics(body)
    for sweep in range(2):
        progress(f"shapes under the hand, sweep {sweep + 1}")
        fitted |= fit_sensors(_known(shown, CloudFit(skin, net, turned(angle), shown[0].side), statics, net, twin), twin)
        twin = replace(twin, values={**twin.values, **{name: f.value for name, f in fitted.items()}})
    progress("bands under the hand")
    bands = _bands(
        [s for s in shown if s.nodes is None and s.frames()], CloudFit(skin, net, turned(angle), shown[0].side), net, twin
    )
    stds = {p.name: p.std for p in twin.robot.nuisance}
    unfixed = tuple(n for n in stds if n not in fitted or (fitted[n].std or 0.0) > 0.5 * (stds[n] or np.inf))
    frames = sum(len(s.frames()) for s in shown)
    after = _misfit(skin, shown, angle)
    return Aligned(twin, fitted, bands, before, after, frames, unfixed, notices, time.perf_counter() - begun)


def _shown(recording: Recording, twin: Twin) -> tuple[list[Shown], tuple[str, ...]]:
    if not any(t.clouds is not None for t in recording.trials):
        raise DataError(f"{recording.title}: no trial has clouds; alignment needs them (`cloud` of a [[trial]])")
    everything, notices = sense(recording, twin)  # refuses a broken set, also where it breaks in a trial without clouds
    keep = [k for k, t in enumerate(recording.trials) if t.clouds is not None]
    chosen, sensed = recording.select(keep), [everything[k] for k in keep]
    if all(s.pushed for s in sensed):
        raise DataError(f"{recording.title}: a hand is on the finger in every trial with clouds; one free motion is needed")
    free = chosen.select([k for k, s in enumerate(sensed) if not s.pushed])
    bench = prepare(free, twin.robot)
    nodes = {
        i.name: trace.path.q.reshape(len(i.time), -1, 3)
        for i, trace in zip(bench.inputs, simulate(twin, bench), strict=True) if trace.path is not None
    }  # fmt: skip
    clouds = {t.name: t.clouds for t in chosen.trials}
    seen = side([c for c in clouds.values() if c is not None])
    return [Shown(s, c, seen, nodes.get(s.name)) for s in sensed if (c := clouds[s.name]) is not None], notices


def _residuals(skin: Skin, shown: Sequence[Shown], angle: float) -> np.ndarray:
    """Distances (k,) m of the free trials' clouds from the skin turned by `angle`."""
    turn, out = turned(angle), []
    for trial in shown:
        for i, cloud in trial.frames() if trial.nodes is not None else []:
            x, normals = skin.at(trial.nodes[i])  # type: ignore[index]
            out.append(distances(cloud @ turn, x, normals, facing(normals, turn, trial.side))[0])
    return np.concatenate(out)


def _misfit(skin: Skin, shown: Sequence[Shown], angle: float) -> float:
    return float(np.sqrt((_residuals(skin, shown, angle) ** 2).mean()))


def _angle(skin: Skin, shown: Sequence[Shown], twin: Twin) -> tuple[float, float]:
    """The mounting angle (rad) and its standard error. Sought without slopes: which skin point is nearest changes from
    angle to angle, so that these are rough (least squares stopped 0.47 deg off its own minimum on bench day 513)."""
    p = next(p for p in twin.robot.nuisance if p.name == "mounting.angle")

    def misfit(angle: float) -> float:
        return float((np.sqrt(1.0 + (_residuals(skin, shown, angle) / (BEYOND * CLOUD)) ** 2) - 1.0).sum())

    found = float(np.squeeze(fminbound(misfit, p.low, p.high, xtol=ANGLE)))
    h = 2e-3
    slope = (_residuals(skin, shown, found + h) - _residuals(skin, shown, found - h)) / (2 * h * CLOUD)
    return found, float(1.0 / np.sqrt((slope**2).sum()))


def _known(shown: Sequence[Shown], fit: CloudFit, statics: SoftStatics, net: Network, twin: Twin) -> Known:
    """Strains that the shapes have, and resistances measured there."""
    body = feeling(twin)
    parts = []
    for trial in shown:
        if trial.nodes is not None:
            eps = statics.sensed(trial.nodes)["strain"]
            covariance = np.broadcast_to(FREE**2 * np.eye(eps.shape[1]), (len(eps), eps.shape[1], eps.shape[1]))
            parts.append((eps, trial.sensed.resistance, covariance))
            continue
        _, found, at = behind(trial, fit, net, body)
        strains = [strained(statics, net, z, covariance) for z, covariance in found]
        parts.append((np.stack([e for e, _ in strains]), trial.sensed.resistance[at], np.stack([c for _, c in strains])))
    return Known(*(np.concatenate(p) for p in zip(*parts, strict=True)))


def _bands(pushed: Sequence[Shown], fit: CloudFit, net: Network, twin: Twin) -> Bands:
    if not pushed:
        return Bands()
    behind, by = [_behind(trial, fit, net, twin) for trial in pushed], {}
    for name, law in estimators().items():
        with suppress(DataError):  # no weights of it for this robot: nobody will estimate with it either
            by[name] = widened_by(law(twin), behind)
    return Bands(by, tuple(sorted({trial.sensed.contact or "" for trial in pushed})))


def behind(
    trial: Shown, fit: CloudFit, net: Network, body: SoftBody
) -> tuple[Felt, list[tuple[np.ndarray, np.ndarray]], list[int]]:
    """What was felt at a trial's clouds, coordinates of the shapes behind these with their covariance, and the samples."""
    frames = trial.frames()
    at = [i for i, _ in frames]
    felt = Felt(strain(trial.sensed.resistance[at], body.cords), trial.sensed.displacement[at])
    start = net(felt)[0]
    return felt, [fit(cloud, z) for (_, cloud), z in zip(frames, start, strict=True)], at


def strained(statics: SoftStatics, net: Network, z: np.ndarray, covariance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Strains (s,) of a shape and their covariance (s, s)."""
    eps = statics.sensed(net.modes.nodes(np.concatenate([z[None], z + STEP * np.eye(len(z))])))["strain"]
    slope = (eps[1:] - eps[0]).T / STEP
    return eps[0], slope @ covariance @ slope.T + PUSHED**2 * np.eye(len(slope))


def _behind(trial: Shown, fit: CloudFit, net: Network, twin: Twin) -> Behind:
    """The named points behind a pushed trial's clouds."""
    body = feeling(twin)
    felt, found, at = behind(trial, fit, net, body)
    weights = body.lattice.weights(named_points(twin.robot).rest)
    moved = np.einsum("pn,fnc->fpc", weights, net.modes.nodes(np.stack([z for z, _ in found])))
    basis = np.einsum("pn,knc->kpc", weights, net.modes.basis.reshape(len(net.modes.basis), -1, 3))
    variance = [np.einsum("kpc,kl,lpc->p", basis, c, basis, optimize=True) for _, c in found]
    time_of = trial.sensed.time[at]
    return Behind(felt, float(time_of[-1] - time_of[0]), moved, np.sqrt(np.stack(variance)))
