"""Sensors under a hand: what they felt beside what the seen shape stretches them by. A check on a diagnosis, and no part of it.

Of a force nobody knows no shape is predicted. But the shape is seen, by clouds or markers, and from it the strains of the cords
follow without mechanics: coordinates of deformation modes are fitted to what is seen (`cloud_fit.py`; `MarkerFit` here), and what
the resistances say is read through a twin's sensor law and its effects (`sensing.py`). What the two differ by is the sensors' own.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from twin.bench import prepare
from twin.measurements import Recording
from twin.measurements.patches import side
from twin.measurements.recording import CONTACT
from twin.shape.align import Shown, behind, strained
from twin.shape.cloud_fit import SETTLED, CloudFit
from twin.shape.modal import Network
from twin.shape.sensing import Sensed, feeling, sense
from twin.soft import SoftStatics
from twin.soft.skin import Skin
from twin.soft.statics import turned
from twin.threads import single_thread
from twin.twin import Twin

MARKER = 4e-4  # m, noise of a marker whose channel declares none
FEWEST = 6  # markers seen at once: with fewer the habit of the modes says more than they do
EVERY = 0.1  # s: markers of rows closer than that show one shape
ROUNDS = 8

Seen = tuple[np.ndarray, np.ndarray]  # strains (f, s), and their variances


@dataclass(frozen=True)
class UnderHand:
    """The trials with a hand on the robot and how many shapes were seen in them; root mean squares (s,) of felt less seen strain,
    by the twin before a diagnosis and after it, and of the seen strain's standard error. NaN for a sensor that says nothing."""

    trials: tuple[str, ...]
    frames: int
    before: np.ndarray
    after: np.ndarray
    seen: np.ndarray


def under_hand(recording: Recording, before: Twin, after: Twin) -> UnderHand | None:
    """None where no trial has a hand on the robot, or none of these shows a shape. Raises DataError for a robot that feels no
    strain, a sensor without a column, or a robot without trained modes."""
    if not any(CONTACT in t.other for t in recording.trials):
        return None
    with single_thread():
        felt = [{s.name: s for s in sense(recording, twin)[0] if s.pushed} for twin in (before, after)]
        names, rows, seen = [], [], []
        for sensed, at, shapes in _shapes(recording, list(felt[0].values()), before):
            names.append(sensed.name)
            rows.append(at)
            seen.append(shapes)
    if not names:
        return None
    strain, variance = (np.concatenate(part) for part in zip(*seen, strict=True))
    off = []
    for twin, of in zip((before, after), felt, strict=True):
        cords = feeling(twin).cords
        off.append(np.concatenate([of[n].strain(cords)[at] for n, at in zip(names, rows, strict=True)]) - strain)
    return UnderHand(tuple(names), len(strain), _rms(off[0]), _rms(off[1]), np.sqrt(variance.mean(axis=0)))


def _rms(x: np.ndarray) -> np.ndarray:
    """(s,) over the rows that are there."""
    there = np.isfinite(x)
    count = there.sum(axis=0)
    square = np.where(there, x, 0.0) ** 2
    return np.sqrt(np.where(count > 0, square.sum(axis=0) / np.maximum(count, 1), np.nan))


def _shapes(recording: Recording, pushed: Sequence[Sensed], twin: Twin) -> Iterator[tuple[Sensed, np.ndarray, Seen]]:
    """Trial by trial what was seen: its samples, and strains there. By clouds where there are any, else by markers."""
    clouds = {t.name: t.clouds for t in recording.trials}
    body, net = feeling(twin), Network.of(twin.robot)
    statics = SoftStatics(body)
    markers = MarkerFit(recording, twin, statics, net)
    camera = side([c for c in clouds.values() if c is not None])
    fit = CloudFit(Skin.of(body), net, turned(body.turn), camera)
    for sensed in pushed:
        cloud = clouds[sensed.name]
        if cloud is not None:
            shown = Shown(sensed, cloud, camera, None)
            _, found, at = behind(shown, fit, net, body) if shown.frames() else (None, [], [])
        else:
            found, at = markers.trial(sensed)
        if at:
            strains = [strained(statics, net, z, covariance) for z, covariance in found]
            of = np.stack([e for e, _ in strains]), np.stack([np.diag(c) for _, c in strains])
            yield sensed, np.array(at), of


class MarkerFit:
    """The shape behind the markers of one row: the most probable coordinates z of the modes,

    sum_m |y_m - x_m(z)|^2 / sigma^2  +  e' C^-1 e,    e as in `cloud_fit.py`
    """

    def __init__(self, recording: Recording, twin: Twin, statics: SoftStatics, net: Network) -> None:
        free = replace(recording, trials=tuple(replace(t, other={}) for t in recording.trials))  # who pushed is no matter here
        self.bench = prepare(free, twin.robot)
        self.columns = [k for k, o in enumerate(self.bench.outputs) if o.group == "marker"]
        outputs = [self.bench.outputs[k] for k in self.columns]
        self.noise = np.array([o.channel.noise or MARKER for o in outputs])
        self.net, self.at = net, [(o.index, o.axis) for o in outputs]
        nodes = net.modes.nodes(np.concatenate([np.zeros((1, len(net.modes.basis))), np.eye(len(net.modes.basis))]))
        places = twin.body().frame.reported(statics.markers(nodes))  # (1 + k, m, 3): linear in z
        picked = np.stack([places[:, i, axis] for i, axis in self.at], axis=1) if outputs else np.zeros((len(nodes), 0))
        self.mean, self.basis = picked[0], picked[1:] - picked[0]

    def trial(self, sensed: Sensed) -> tuple[list[tuple[np.ndarray, np.ndarray]], list[int]]:
        """Coordinates (k,) m and their covariance of rows that show enough markers, and which rows these are."""
        found, at, last = [], [], -np.inf
        places = next(y for i, y in zip(self.bench.inputs, self.bench.measured, strict=True) if i.name == sensed.name)
        for row, y in enumerate(places[:, self.columns]):
            if np.isfinite(y).sum() >= 3 * FEWEST and sensed.time[row] >= last + EVERY:
                found.append(self(y))
                at.append(row)
                last = sensed.time[row]
        return found, at

    def __call__(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        there = np.isfinite(y)
        J = (self.basis[:, there] / self.noise[there]).T
        r, z, habit = (y - self.mean)[there] / self.noise[there], np.zeros(len(self.basis)), self.net.habit
        H = J.T @ J
        for _ in range(ROUNDS):
            away, D = habit(z)
            H = J.T @ J + D.T @ habit.inverse @ D
            step = np.linalg.solve(H, J.T @ (r - J @ z) - D.T @ habit.inverse @ away)
            z = z + step
            if np.linalg.norm(step) < SETTLED:
                break
        return z, np.linalg.inv(H)
