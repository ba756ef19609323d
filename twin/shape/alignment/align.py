"""Align a twin to a built finger from partial clouds, without labels: mounting angle, R0 and kappa of every sensor.

1. Mounting angle: without contact, tendons of known length give the shape; it is turned until the clouds lie on it.
2. Shape under contact: coordinates of the twin's deformation modes, frame by frame (`cloud_fit.py`).
3. Sensors: with both kinds of shapes the strains are known, and sqrt(R) = a + a kappa+ max(eps, 0) + a kappa- min(eps, 0), a =
   sqrt(R0), is linear in (a, a kappa+, a kappa-): least squares, robust, with the robot's priors.
4. Bands: the distance of each estimate from the shapes by tendons and behind the clouds sets the band width of this finger, in
   free motion and under this contact (`band_widening.py`).

Every step is smooth and small; `tools/benchmarks/shape/error.py` compares it with a black-box search over all numbers at once.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import fminbound

from twin.body.strain_cords import strain
from twin.foundation.errors import DataError
from twin.foundation.parallel import single_thread
from twin.foundation.parameters import FittedValue
from twin.measurements import Clouds, Recording
from twin.measurements.patches import camera_direction
from twin.mechanics.silicone import SoftBody, SoftStatics
from twin.mechanics.silicone.skin import Skin, is_visible, signed_distances
from twin.mechanics.silicone.statics import rotation_about_z
from twin.prediction.prepared import prepare
from twin.prediction.simulate import simulate
from twin.prediction.twin import Twin
from twin.robots.named_points import named_points
from twin.shape.alignment.band_widening import BandWidening, ShapeReference, fit_free_widening, fit_widening
from twin.shape.alignment.cloud_fit import CLOUD_NOISE, ROBUST_LIMIT, CloudFit
from twin.shape.alignment.sensor_fit import CLOUD_STRAIN_ERROR, TENDON_STRAIN_ERROR, StrainSamples, fit_sensors
from twin.shape.estimators.estimator import SensorReadings, estimators
from twin.shape.estimators.modal import ModalNetwork
from twin.shape.sensing import SensedTrial, read_sensors, sensing_finger

MODE_DIFFERENCE = 1e-4  # m in z, of difference quotients
MOUNTING_ANGLE_TOLERANCE = 2e-4  # rad, of the mounting angle


@dataclass(frozen=True)
class Alignment:
    """The aligned twin, its fitted numbers with standard errors, and the data behind them.

    `distance_before` and `distance_after` m: root mean square distances of the clouds from the visible skin; `cloud_count` clouds
    used; `undetermined`: numbers that the clouds do not determine; `widening`: factors of the bands.
    """

    twin: Twin
    fitted: Mapping[str, FittedValue]
    widening: BandWidening
    distance_before: float
    distance_after: float
    cloud_count: int
    undetermined: tuple[str, ...]
    notices: tuple[str, ...]
    seconds: float


@dataclass(frozen=True)
class CloudTrial:
    """A trial with clouds: its readings, the direction (3,) to the camera, and, without contact, the shapes (n, n_free, 3) m."""

    sensed: SensedTrial
    clouds: Clouds
    view_direction: np.ndarray
    nodes: np.ndarray | None

    def cloud_frames(self) -> list[tuple[int, np.ndarray]]:
        """Return the sample next to each cloud, and the cloud's points."""
        at = np.abs(self.sensed.time[None] - self.clouds.time[:, None]).argmin(axis=1)
        o = self.clouds.offsets
        return [(int(i), self.clouds.points[o[f] : o[f + 1]]) for f, i in enumerate(at) if o[f + 1] > o[f]]


def align(recording: Recording, twin: Twin, progress: Callable[[str], None] = lambda words: None) -> Alignment:
    """Align the twin to a recording with clouds. Raises DataError where no trial has clouds, or all of them have contact."""
    with single_thread():
        return _align(recording, twin, progress)


def _align(recording: Recording, twin: Twin, progress: Callable[[str], None]) -> Alignment:
    """Align in one thread."""
    started = time.perf_counter()
    trials, notices = _cloud_trials(recording, twin)
    body = sensing_finger(twin)
    skin = Skin.of(body)
    progress("turning the finger onto its clouds")
    before = _rms_cloud_distance(skin, trials, body.turn)
    angle, angle_std = _fit_mounting_angle(skin, trials, twin)
    net = ModalNetwork.of(twin.robot)
    fitted: dict[str, FittedValue] = {"mounting.angle": FittedValue(angle, angle_std, "rad")}
    statics = SoftStatics(body)
    for sweep in range(2):
        progress(f"shapes under the hand, sweep {sweep + 1}")
        fitted |= fit_sensors(
            _strain_samples(trials, CloudFit(skin, net, rotation_about_z(angle), trials[0].view_direction), statics, net, twin),
            twin,
        )
        twin = replace(twin, values={**twin.values, **{name: f.value for name, f in fitted.items()}})
    progress("bands of this finger")
    bands = _fit_band_widening(
        [s for s in trials if s.cloud_frames()],
        CloudFit(skin, net, rotation_about_z(angle), trials[0].view_direction),
        net,
        twin,
    )
    stds = {p.name: p.std for p in twin.robot.nuisance}
    unfixed = tuple(n for n in stds if n not in fitted or (fitted[n].std or 0.0) > 0.5 * (stds[n] or np.inf))
    frames = sum(len(s.cloud_frames()) for s in trials)
    after = _rms_cloud_distance(skin, trials, angle)
    return Alignment(twin, fitted, bands, before, after, frames, unfixed, notices, time.perf_counter() - started)


def _cloud_trials(recording: Recording, twin: Twin) -> tuple[list[CloudTrial], tuple[str, ...]]:
    """Return the trials with clouds, and notices of the sensors."""
    if not any(t.clouds is not None for t in recording.trials):
        raise DataError(f"{recording.title}: no trial has clouds; alignment needs them (`cloud` of a [[trial]])")
    all_sensed, notices = read_sensors(recording, twin)  # refuses a broken set, also in trials without clouds
    with_clouds = [k for k, t in enumerate(recording.trials) if t.clouds is not None]
    chosen, sensed = recording.select(with_clouds), [all_sensed[k] for k in with_clouds]
    if all(s.pushed for s in sensed):
        raise DataError(f"{recording.title}: a hand is on the finger in every trial with clouds; one free motion is needed")
    free = chosen.select([k for k, s in enumerate(sensed) if not s.pushed])
    prepared = prepare(free, twin.robot)
    nodes = {
        i.name: trace.solution.q.reshape(len(i.time), -1, 3)
        for i, trace in zip(prepared.inputs, simulate(twin, prepared), strict=True) if trace.solution is not None
    }  # fmt: skip
    clouds = {t.name: t.clouds for t in chosen.trials}
    direction = camera_direction([c for c in clouds.values() if c is not None])
    return [CloudTrial(s, c, direction, nodes.get(s.name)) for s in sensed if (c := clouds[s.name]) is not None], notices


def _cloud_distances(skin: Skin, trials: Sequence[CloudTrial], angle: float) -> np.ndarray:
    """Return the distances (k,) m of the free trials' clouds from the skin turned by `angle`."""
    turn, distances = rotation_about_z(angle), []
    for trial in trials:
        for i, cloud in trial.cloud_frames() if trial.nodes is not None else []:
            x, normals = skin.points_and_normals(trial.nodes[i])  # type: ignore[index]
            distances.append(signed_distances(cloud @ turn, x, normals, is_visible(normals, turn, trial.view_direction))[0])
    return np.concatenate(distances)


def _rms_cloud_distance(skin: Skin, trials: Sequence[CloudTrial], angle: float) -> float:
    """Return the root mean square of these distances, m."""
    return float(np.sqrt((_cloud_distances(skin, trials, angle) ** 2).mean()))


def _fit_mounting_angle(skin: Skin, trials: Sequence[CloudTrial], twin: Twin) -> tuple[float, float]:
    """Return the mounting angle (rad) and its standard error.

    Found without slopes: the nearest skin point changes from angle to angle, so slopes are rough and least squares may stop half a
    degree off its own minimum.
    """
    p = next(p for p in twin.robot.nuisance if p.name == "mounting.angle")

    def misfit(angle: float) -> float:
        return float((np.sqrt(1.0 + (_cloud_distances(skin, trials, angle) / (ROBUST_LIMIT * CLOUD_NOISE)) ** 2) - 1.0).sum())

    found = float(np.squeeze(fminbound(misfit, p.low, p.high, xtol=MOUNTING_ANGLE_TOLERANCE)))
    h = 2e-3
    slope = (_cloud_distances(skin, trials, found + h) - _cloud_distances(skin, trials, found - h)) / (2 * h * CLOUD_NOISE)
    return found, float(1.0 / np.sqrt((slope**2).sum()))


def _strain_samples(
    trials: Sequence[CloudTrial], fit: CloudFit, statics: SoftStatics, net: ModalNetwork, twin: Twin
) -> StrainSamples:
    """Return the strains of the shapes, and the resistances measured there."""
    body = sensing_finger(twin)
    parts = []
    for trial in trials:
        if trial.nodes is not None:
            eps = statics.sensor_signals(trial.nodes)["strain"]
            covariance = np.broadcast_to(TENDON_STRAIN_ERROR**2 * np.eye(eps.shape[1]), (len(eps), eps.shape[1], eps.shape[1]))
            parts.append((eps, trial.sensed.resistance, covariance))
            continue
        _, coordinates, at = fit_cloud_shapes(trial, fit, net, body)
        strains = [strain_at(statics, net, z, covariance) for z, covariance in coordinates]
        parts.append((np.stack([e for e, _ in strains]), trial.sensed.resistance[at], np.stack([c for _, c in strains])))
    return StrainSamples(*(np.concatenate(p) for p in zip(*parts, strict=True)))


def _fit_band_widening(trials: Sequence[CloudTrial], fit: CloudFit, net: ModalNetwork, twin: Twin) -> BandWidening:
    """Return how far the bands are widened in free motion, and under the contact of the pushed trials."""
    free = [_tendon_reference(trial, twin) for trial in trials if trial.nodes is not None]
    pushed, factors, free_factors = [t for t in trials if t.nodes is None], {}, {}
    references = [_cloud_reference(trial, fit, net, twin) for trial in pushed]
    for name, kind in estimators().items():
        with suppress(DataError):  # no weights for this robot: the estimator cannot be used either
            estimator = kind(twin)
            if free:
                free_factors[name] = fit_free_widening(estimator, free)
            if references:
                factors[name] = fit_widening(estimator, references)
    return BandWidening(factors, tuple(sorted({trial.sensed.contact or "" for trial in pushed})), free_factors)


def fit_cloud_shapes(
    trial: CloudTrial, fit: CloudFit, net: ModalNetwork, body: SoftBody
) -> tuple[SensorReadings, list[tuple[np.ndarray, np.ndarray]], list[int]]:
    """Return the readings at a trial's clouds, the mode coordinates of the shapes with their covariance, and the samples."""
    frames = trial.cloud_frames()
    at = [i for i, _ in frames]
    readings = SensorReadings(strain(trial.sensed.resistance[at], body.cords), trial.sensed.displacement[at])
    start = net(readings)[0]
    return readings, [fit(cloud, z) for (_, cloud), z in zip(frames, start, strict=True)], at


def strain_at(statics: SoftStatics, net: ModalNetwork, z: np.ndarray, covariance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the strains (s,) of a shape and their covariance (s, s)."""
    eps = statics.sensor_signals(net.modes.nodes(np.concatenate([z[None], z + MODE_DIFFERENCE * np.eye(len(z))])))["strain"]
    slope = (eps[1:] - eps[0]).T / MODE_DIFFERENCE
    return eps[0], slope @ covariance @ slope.T + CLOUD_STRAIN_ERROR**2 * np.eye(len(slope))


def _cloud_reference(trial: CloudTrial, fit: CloudFit, net: ModalNetwork, twin: Twin) -> ShapeReference:
    """Return the named points behind a pushed trial's clouds."""
    body = sensing_finger(twin)
    readings, coordinates, at = fit_cloud_shapes(trial, fit, net, body)
    weights = body.lattice.weights(named_points(twin.robot).rest)
    displacements = np.einsum("pn,fnc->fpc", weights, net.modes.nodes(np.stack([z for z, _ in coordinates])))
    basis = np.einsum("pn,knc->kpc", weights, net.modes.basis.reshape(len(net.modes.basis), -1, 3))
    variance = [np.einsum("kpc,kl,lpc->p", basis, c, basis, optimize=True) for _, c in coordinates]
    time = trial.sensed.time[at]
    return ShapeReference(readings, float(time[-1] - time[0]), displacements, np.sqrt(np.stack(variance)))


def _tendon_reference(trial: CloudTrial, twin: Twin) -> ShapeReference:
    """Return the named points of a free trial at its clouds, as its tendons make them."""
    assert trial.nodes is not None
    body, at = sensing_finger(twin), [i for i, _ in trial.cloud_frames()]
    readings = SensorReadings(strain(trial.sensed.resistance[at], body.cords), trial.sensed.displacement[at], pushed=False)
    displacements = np.einsum("pn,fnc->fpc", body.lattice.weights(named_points(twin.robot).rest), trial.nodes[at])
    time = trial.sensed.time[at]
    return ShapeReference(readings, float(time[-1] - time[0]), displacements, np.zeros(displacements.shape[:2]))
