"""What an experiment lacks, in words, and the effects it then hides or confuses (diagnosis needs reversals, rates, loads, ...)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from twin.body import Drive
from twin.diagnosis.thresholds import FAST, ONE_WAY, PULLED, RESOLVED, STEADY, STILL, WARM
from twin.prediction.evaluate import OUTPUT_GROUPS
from twin.prediction.prepared import Inputs, PreparedRecording


def shortcomings(prepared: PreparedRecording) -> list[tuple[str, set[str]]]:
    """What the design lacks, in words, and the effects it then hides or confuses."""
    inputs = prepared.inputs
    out: list[tuple[str, set[str]]] = []
    top = max(float(np.abs(i.command).max()) for i in inputs)
    changes = np.concatenate([np.diff(i.command, axis=0) for i in inputs])
    rising, falling = (float(np.maximum(c, 0.0).sum()) for c in (changes, -changes))
    if min(rising, falling) < ONE_WAY * max(rising, falling):
        out.append(("loading and unloading", {"tendon_friction", "tendon_backlash", "backbone_creep", "actuator_saturation"}))
    every = np.array([r for i in inputs for r in rates(i, top)])
    if every.size == 0 or np.quantile(every, 0.9) < FAST**0.5 * np.quantile(every, 0.1):  # one pull alone may be sealed
        out.append(("two rates of pull, ten times apart", {"backbone_creep", "time_delay", "actuator_lag"}))
    if max(longest_rest(i, top) for i in inputs) < STEADY:
        out.append(("holds of a minute", {"backbone_creep"}))
    loads = {(round(i.loads.payload, 6), *np.round(i.loads.gravity, 3)) for i in inputs}
    if len(loads) < 2:
        hidden = {"base_tilt", "camera_misalignment", "tip_payload", "backbone_precurvature", "load_cell_bias"}
        out.append(("two payloads, or two mounts", hidden))
    if len(set().union(*(pulled(i, top) for i in inputs))) < prepared.n_tendon:
        hidden = {"stiffness_asymmetry", "load_cell_crosstalk", "load_cell_gain", "tendon_routing", "contact"}
        out.append(("pulls of every tendon, alone and together", hidden))
    if len({o.index for o in prepared.outputs if OUTPUT_GROUPS[o.group].is_point}) < 3:
        hidden = {"stiffness_gradient", "camera_misalignment", "backbone_precurvature", "tendon_routing", "base_tilt"}
        out.append(("three markers along the body", hidden))
    if Drive.DISPLACEMENT not in prepared.drives and not any(o.group == "displacement" for o in prepared.outputs):
        out.append(("tendon displacements", {"tendon_backlash", "tendon_elasticity"}))
    if np.ptp(np.concatenate([i.temperature for i in inputs])) < WARM:
        out.append((f"a logged room temperature that varies by {WARM:.0f} K or more", {"temperature_softening"}))
    if len(inputs) > 2 and _ordered(prepared):
        out.append(
            ("a random order of the trials", {"load_cell_drift", "backbone_ageing", "temperature_softening", "backbone_creep"})
        )
    return out


def pulled(inputs: Inputs, top: float) -> list[int]:
    """The tendons that move in a trial, by more than `PULLED` of the largest command `top`."""
    return [int(t) for t in np.flatnonzero(np.ptp(inputs.command, axis=0) > PULLED * top)]


def rates(inputs: Inputs, top: float) -> list[float]:
    """How fast each tendon is pulled that moves: the median slope of its moving samples."""
    slope = np.abs(np.diff(inputs.command, axis=0)) / np.diff(inputs.time)[:, None]
    found = []
    for t in pulled(inputs, top):
        moving = slope[:, t] > 0.1 * slope[:, t].max()
        if moving.sum() >= RESOLVED:
            found.append(float(np.median(slope[moving, t])))
    return found


def longest_rest(inputs: Inputs, top: float) -> float:
    """The longest stretch (s) of a trial in which nothing moves."""
    still = np.abs(np.diff(inputs.command, axis=0)).max(axis=1) < STILL * top
    best, since = 0.0, None
    for k, s in enumerate(still):
        if s:
            since = inputs.time[k] if since is None else since
            best = max(best, float(inputs.time[k + 1] - since))
        else:
            since = None
    return best


def _ordered(prepared: PreparedRecording) -> bool:
    """Whether trials come in blocks, of one payload or of one tendon pulled most: fewer changes from trial to trial than half of
    what chance would give."""
    return _blocked([i.loads.payload for i in prepared.inputs]) or _blocked(
        [int(np.argmax(np.ptp(i.command, axis=0))) for i in prepared.inputs]
    )


def _blocked(labels: Sequence[float]) -> bool:
    counts = np.array([labels.count(x) for x in set(labels)])
    if len(counts) < 2:
        return False
    n = len(labels)
    expected = (n - 1) * (1.0 - float((counts * (counts - 1)).sum()) / (n * (n - 1)))
    return sum(a != b for a, b in pairwise(labels)) < 0.5 * expected
