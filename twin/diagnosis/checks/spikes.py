"""Marker samples that stand alone: off their neighbours in time, while the markers beside them are not."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from twin.diagnosis.thresholds import MOST_SPIKES_SHARE, SHARED_MOTION_SHARE, SPIKE_SIZE, SPIKE_WINDOW
from twin.prediction.evaluate import OUTPUT_GROUPS
from twin.prediction.prepared import PreparedRecording


def without_spikes(prepared: PreparedRecording, predicted: Sequence[np.ndarray]) -> tuple[PreparedRecording, list[str]]:
    """The bench with lone marker samples missing, and what was left out, in words.

    `predicted` (n_k, n_output), of any twin of the robot, takes the commanded motion off the measured one. What is left departs
    from its median over `SPIKE_WINDOW` rows by d (m), one a marker (Hampel filter: Pearson et al., EURASIP J. Adv. Signal Process.
    2016:87). A body that moves takes all markers along, each by some part of its travel, the RMS of `predicted`: a sample stands
    alone if others would have shown that and none did.
    """
    markers: dict[str, list[int]] = {}
    for column, output in enumerate(prepared.outputs):
        if OUTPUT_GROUPS[output.group].is_point:
            markers.setdefault(output.channel.name.rsplit("_", 1)[0], []).append(column)
    columns = [np.array(c) for c in markers.values()]
    trials = [k for k, y in enumerate(prepared.measured) if np.isfinite(y).any()]  # the others are sealed, or empty
    if len(columns) < 2 or not trials:
        return prepared, []
    departed = [_departure(prepared.measured[k] - predicted[k], columns) for k in trials]
    moved = np.concatenate([y - y.mean(axis=0) for y in predicted])
    travel = np.array([np.sqrt((moved[:, c] ** 2).sum(axis=1).mean()) for c in columns]) + 1e-9
    declared = np.array(
        [prepared.outputs[c[0]].channel.noise or OUTPUT_GROUPS[prepared.outputs[c[0]].group].typical_noise for c in columns]
    )
    alone = _alone(np.concatenate(departed), travel, declared)
    counts = dict(zip(markers, alone.sum(axis=0).tolist(), strict=True))
    faulty = {name for name, count in counts.items() if count > MOST_SPIKES_SHARE * len(alone)}
    words = [
        f"{name}: {counts[name]} of {len(alone)} samples are off their neighbours in time and no motion of the body, too many"
        " for accidents: left in, look at this marker"
        for name in sorted(faulty)
    ]
    alone[:, [name in faulty for name in markers]] = False
    if alone.any():
        told = ", ".join(f"{name} {count}" for name, count in counts.items() if count and name not in faulty)
        far = 1e3 * float(_size(np.concatenate(departed))[alone].max())
        words.append(
            f"spikes left out, off their neighbours in time and no motion of the body (samples: {told}), up to {far:.1f} mm"
        )
    measured = [y.copy() for y in prepared.measured]
    for k, hit in zip(trials, np.split(alone, np.cumsum([len(x) for x in departed])[:-1]), strict=True):
        for j, column in enumerate(columns):
            measured[k][np.ix_(hit[:, j], column)] = np.nan
    return replace(prepared, measured=tuple(measured)), words


def _departure(off: np.ndarray, columns: Sequence[np.ndarray]) -> np.ndarray:
    """(n, n_marker, 3) m from the median of `SPIKE_WINDOW` rows, at the ends of the nearest whole window; NaN where missing.

    In a median a missing row stands on the line between its neighbours: without it a fast motion would shift the middle.
    """
    if len(off) < SPIKE_WINDOW:
        return np.full((len(off), len(columns), 3), np.nan)
    whole, row = off.copy(), np.arange(len(off))
    for column in whole.T:
        known = np.isfinite(column)
        column[~known] = np.interp(row[~known], row[known], column[known]) if known.any() else 0.0
    middle = np.median(np.lib.stride_tricks.sliding_window_view(whole, SPIKE_WINDOW, axis=0), axis=2)
    departed = off - np.pad(middle, ((SPIKE_WINDOW // 2, SPIKE_WINDOW // 2), (0, 0)), mode="edge")
    out = np.zeros((len(off), len(columns), 3))
    for j, column in enumerate(columns):
        out[:, j, : len(column)] = departed[:, column]
    return out


def _size(departed: np.ndarray) -> np.ndarray:
    return np.linalg.norm(departed, axis=-1)


def _alone(departed: np.ndarray, travel: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """Which of the departures (n, m, 3) no motion of the body explains, (n, m); travel and declared noise (m,)."""
    size = _size(departed)
    seen = np.array([np.nanmedian(d) if np.isfinite(d).any() else np.inf for d in size.T])
    typical = np.maximum(seen, noise)  # markers that mostly stand still, or of a coarse camera, depart by nothing
    rows, own = np.nonzero(size > SPIKE_SIZE * typical)
    theirs = (size[rows, own] / travel[own])[:, None] * travel  # what the others' part would be
    telling = (theirs > SPIKE_SIZE * typical) & np.isfinite(size[rows]) & (np.arange(len(travel)) != own[:, None])
    along = np.einsum("kmx,kx->km", departed[rows], departed[rows, own])
    alike = along > 0.5 * size[rows] * size[rows, own][:, None]
    shared = telling & alike & (size[rows] > SHARED_MOTION_SHARE * theirs)
    lone = telling.any(axis=1) & ~shared.any(axis=1)
    out = np.zeros(size.shape, bool)
    out[rows[lone], own[lone]] = True
    return out
