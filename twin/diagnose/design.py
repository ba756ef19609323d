"""What an experiment lacks, in words, and the effects it then hides or confuses (diagnosis needs reversals, rates, loads, ...)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from twin.bench import Bench

RESOLVED = 8  # samples of a pull that show its rate: a jump from one level to the next is none
STEADY = 20.0  # s without motion that count as a hold
FAST = 10.0  # ratio of the fastest to the slowest pull that counts as two rates
WARM = 2.0  # K of spread in the room's temperature


def shortcomings(bench: Bench) -> list[tuple[str, set[str]]]:
    """What the design lacks, in words, and the effects it then hides or confuses."""
    inputs = bench.inputs
    out: list[tuple[str, set[str]]] = []
    rising, falling, held, pulled = 0.0, 0.0, 0.0, set()
    top = max(float(np.abs(i.command).max()) for i in inputs)
    for i in inputs:
        change = np.diff(i.command, axis=0)
        rising += float(np.maximum(change, 0.0).sum())
        falling += float(np.maximum(-change, 0.0).sum())
        still = np.abs(change).max(axis=1) < 0.02 * top
        held = max(held, _longest(still, i.time))
        pulled |= {int(t) for t in np.flatnonzero(np.ptp(i.command, axis=0) > 0.2 * top)}
    if min(rising, falling) < 0.2 * max(rising, falling):
        out.append(("loading and unloading", {"tendon_friction", "tendon_backlash", "backbone_creep", "actuator_saturation"}))
    rates = _rates(bench, top)
    if rates.size == 0 or np.quantile(rates, 0.9) < FAST**0.5 * np.quantile(rates, 0.1):  # one pull alone may be held out
        out.append(("two rates of pull, ten times apart", {"backbone_creep", "time_delay", "actuator_lag"}))
    if held < STEADY:
        out.append(("holds of a minute", {"backbone_creep"}))
    loads = {(round(i.loads.payload, 6), *np.round(i.loads.gravity, 3)) for i in inputs}
    if len(loads) < 2:
        hidden = {"base_tilt", "camera_misalignment", "tip_payload", "backbone_precurvature", "load_cell_bias"}
        out.append(("two payloads, or two mounts", hidden))
    if len(pulled) < bench.n_tendon:
        hidden = {"stiffness_asymmetry", "load_cell_crosstalk", "load_cell_gain", "tendon_routing", "contact"}
        out.append(("pulls of every tendon, alone and together", hidden))
    if len({o.index for o in bench.outputs if o.group == "marker"}) < 3:
        hidden = {"stiffness_gradient", "camera_misalignment", "backbone_precurvature", "tendon_routing", "base_tilt"}
        out.append(("three markers along the body", hidden))
    if not bench.by_length.any() and not any(o.group == "displacement" for o in bench.outputs):
        out.append(("tendon displacements", {"tendon_backlash", "tendon_elasticity"}))
    if np.ptp(np.concatenate([i.temperature for i in inputs])) < WARM:
        out.append((f"a logged room temperature that varies by {WARM:.0f} K or more", {"temperature_softening"}))
    if len(inputs) > 2 and _ordered(bench):
        out.append(
            ("a random order of the trials", {"load_cell_drift", "backbone_ageing", "temperature_softening", "backbone_creep"})
        )
    return out


def _rates(bench: Bench, top: float) -> np.ndarray:
    """How fast each tendon is pulled in each trial: the median slope of its moving samples, if it moves over `top` / 5."""
    found = []
    for i in bench.inputs:
        slope = np.abs(np.diff(i.command, axis=0)) / np.diff(i.time)[:, None]
        for t in np.flatnonzero(np.ptp(i.command, axis=0) > 0.2 * top):
            moving = slope[:, t] > 0.1 * slope[:, t].max()
            if moving.sum() >= RESOLVED:
                found.append(float(np.median(slope[moving, t])))
    return np.array(found)


def _longest(still: np.ndarray, time: np.ndarray) -> float:
    """The longest stretch (s) of still samples."""
    best, since = 0.0, None
    for k, s in enumerate(still):
        if s:
            since = time[k] if since is None else since
            best = max(best, float(time[k + 1] - since))
        else:
            since = None
    return best


def _ordered(bench: Bench) -> bool:
    """Whether trials come in blocks, of one payload or of one tendon pulled most: fewer changes from trial to trial than half of
    what chance would give."""
    return _blocked([i.loads.payload for i in bench.inputs]) or _blocked(
        [int(np.argmax(np.ptp(i.command, axis=0))) for i in bench.inputs]
    )


def _blocked(labels: Sequence[float]) -> bool:
    counts = np.array([labels.count(x) for x in set(labels)])
    if len(counts) < 2:
        return False
    n = len(labels)
    expected = (n - 1) * (1.0 - float((counts * (counts - 1)).sum()) / (n * (n - 1)))
    return sum(a != b for a, b in pairwise(labels)) < 0.5 * expected
