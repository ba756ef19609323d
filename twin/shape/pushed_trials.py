"""Check the strain sensors in trials with external contact: measured strain against the strain of the observed shape.

A shape under an unknown force cannot be predicted. But the shape is observed, by clouds or markers, and the strains of the cords
follow from it without mechanics: coordinates of deformation modes are fitted to the observation (`cloud_fit.py`; `MarkerFit` here),
and the resistances are read through a twin's sensor law and effects (`sensing.py`). The difference is the sensors' error. This
checks a diagnosis and is no part of it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from twin.foundation.parallel import single_thread
from twin.measurements import Recording
from twin.measurements.patches import camera_direction
from twin.measurements.recording import EXTERNAL_CONTACT
from twin.mechanics.silicone import SoftStatics
from twin.mechanics.silicone.skin import Skin
from twin.mechanics.silicone.statics import rotation_about_z
from twin.prediction.prepared import prepare
from twin.prediction.twin import Twin
from twin.shape.alignment.align import CloudTrial, fit_cloud_shapes, strain_at
from twin.shape.alignment.cloud_fit import MODE_STEP_TOLERANCE, CloudFit
from twin.shape.estimators.modal import ModalNetwork
from twin.shape.sensing import SensedTrial, read_sensors, sensing_finger

DEFAULT_MARKER_NOISE = 4e-4  # m, of a marker whose channel declares no noise
FEWEST_MARKERS_SEEN = 6  # markers in a row: with fewer the mode coupling outweighs them
MARKER_SHAPE_INTERVAL = 0.1  # s: rows closer than that show the same shape
MARKER_FIT_ITERATIONS = 8  # Gauss-Newton steps

ShapeStrains = tuple[np.ndarray, np.ndarray]  # strains (f, s), and their variances


@dataclass(frozen=True)
class PushedTrialCheck:
    """Strain errors of the sensors in trials with contact.

    `trials` checked and how many shapes (`frames`) were observed in them; root mean squares (s,) of measured minus observed strain,
    by the twin before a diagnosis and after it, and of the observed strain's standard error. NaN for a dead sensor.
    """

    trials: tuple[str, ...]
    frames: int
    rms_before: np.ndarray
    rms_after: np.ndarray
    strain_error: np.ndarray


def check_pushed_trials(recording: Recording, before: Twin, after: Twin) -> PushedTrialCheck | None:
    """Compare measured and observed strains, by the twins before and after a diagnosis.

    Returns None where no trial has contact, or none of these shows a shape. Raises DataError for a robot without strain sensors, a
    sensor without a column, or a robot without trained modes.
    """
    if not any(EXTERNAL_CONTACT in t.other for t in recording.trials):
        return None
    with single_thread():
        sensed_by_name = [{s.name: s for s in read_sensors(recording, twin)[0] if s.pushed} for twin in (before, after)]
        names, rows, observed = [], [], []
        for sensed, at, shapes in _observed_strains(recording, list(sensed_by_name[0].values()), before):
            names.append(sensed.name)
            rows.append(at)
            observed.append(shapes)
    if not names:
        return None
    strain, variance = (np.concatenate(part) for part in zip(*observed, strict=True))
    errors = []
    for twin, by_name in zip((before, after), sensed_by_name, strict=True):
        cords = sensing_finger(twin).cords
        errors.append(np.concatenate([by_name[n].strain(cords)[at] for n, at in zip(names, rows, strict=True)]) - strain)
    return PushedTrialCheck(tuple(names), len(strain), _rms(errors[0]), _rms(errors[1]), np.sqrt(variance.mean(axis=0)))


def _rms(x: np.ndarray) -> np.ndarray:
    """Return the root mean square (s,) over the finite rows."""
    finite = np.isfinite(x)
    count = finite.sum(axis=0)
    square = np.where(finite, x, 0.0) ** 2
    return np.sqrt(np.where(count > 0, square.sum(axis=0) / np.maximum(count, 1), np.nan))


def _observed_strains(
    recording: Recording, pushed: Sequence[SensedTrial], twin: Twin
) -> Iterator[tuple[SensedTrial, np.ndarray, ShapeStrains]]:
    """Yield for each trial its rows with an observed shape, and the strains there, from clouds or else from markers."""
    clouds = {t.name: t.clouds for t in recording.trials}
    body, net = sensing_finger(twin), ModalNetwork.of(twin.robot)
    statics = SoftStatics(body)
    markers = MarkerFit(recording, twin, statics, net)
    camera = camera_direction([c for c in clouds.values() if c is not None])
    fit = CloudFit(Skin.of(body), net, rotation_about_z(body.turn), camera)
    for sensed in pushed:
        cloud = clouds[sensed.name]
        if cloud is not None:
            cloud_trial = CloudTrial(sensed, cloud, camera, None)
            _, coordinates, at = fit_cloud_shapes(cloud_trial, fit, net, body) if cloud_trial.cloud_frames() else (None, [], [])
        else:
            coordinates, at = markers.fit_trial(sensed)
        if at:
            strains = [strain_at(statics, net, z, covariance) for z, covariance in coordinates]
            stacked = np.stack([e for e, _ in strains]), np.stack([np.diag(c) for _, c in strains])
            yield sensed, np.array(at), stacked


class MarkerFit:
    """Fit the shape to the markers of one row: the most probable coordinates z of the modes,

    sum_m |y_m - x_m(z)|^2 / sigma^2  +  e' C^-1 e,    e as in `cloud_fit.py`
    """

    def __init__(self, recording: Recording, twin: Twin, statics: SoftStatics, net: ModalNetwork) -> None:
        undisturbed = replace(
            recording, trials=tuple(replace(t, other={}) for t in recording.trials)
        )  # contacts do not matter here
        self.prepared = prepare(undisturbed, twin.robot)
        self.columns = [k for k, o in enumerate(self.prepared.outputs) if o.group == "marker"]
        outputs = [self.prepared.outputs[k] for k in self.columns]
        self.noise = np.array([o.channel.noise or DEFAULT_MARKER_NOISE for o in outputs])
        self.net, self.at = net, [(o.index, o.axis) for o in outputs]
        nodes = net.modes.nodes(np.concatenate([np.zeros((1, len(net.modes.basis))), np.eye(len(net.modes.basis))]))
        places = twin.body().frame.to_marker_frame(statics.markers(nodes))  # (1 + k, m, 3): linear in z
        picked = np.stack([places[:, i, axis] for i, axis in self.at], axis=1) if outputs else np.zeros((len(nodes), 0))
        self.mean, self.basis = picked[0], picked[1:] - picked[0]

    def fit_trial(self, sensed: SensedTrial) -> tuple[list[tuple[np.ndarray, np.ndarray]], list[int]]:
        """Return coordinates (k,) m with their covariance for the rows that show enough markers, and these rows."""
        found, at, last = [], [], -np.inf
        places = next(y for i, y in zip(self.prepared.inputs, self.prepared.measured, strict=True) if i.name == sensed.name)
        for row, y in enumerate(places[:, self.columns]):
            if np.isfinite(y).sum() >= 3 * FEWEST_MARKERS_SEEN and sensed.time[row] >= last + MARKER_SHAPE_INTERVAL:
                found.append(self(y))
                at.append(row)
                last = sensed.time[row]
        return found, at

    def __call__(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the coordinates (k,) m for markers y (m,) m, NaN where unseen, and their covariance (k, k) m^2."""
        finite = np.isfinite(y)
        J = (self.basis[:, finite] / self.noise[finite]).T
        r, z, coupling = (y - self.mean)[finite] / self.noise[finite], np.zeros(len(self.basis)), self.net.coupling
        H = J.T @ J
        for _ in range(MARKER_FIT_ITERATIONS):
            e, D = coupling(z)
            H = J.T @ J + D.T @ coupling.inverse @ D
            step = np.linalg.solve(H, J.T @ (r - J @ z) - D.T @ coupling.inverse @ e)
            z = z + step
            if np.linalg.norm(step) < MODE_STEP_TOLERANCE:
                break
        return z, np.linalg.inv(H)
