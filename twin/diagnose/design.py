"""What an experiment lacks, in words, and the effects it then hides or confuses (diagnosis needs reversals, rates, loads, ...)."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from twin.bench import Bench

STEADY = 20.0  # s without motion that count as a hold
FAST = 10.0  # ratio of the fastest to the slowest pull that counts as two rates
WARM = 2.0  # K of spread in the room's temperature


def shortcomings(bench: Bench) -> list[tuple[str, set[str]]]:
    """What the design lacks, in words, and the effects it then hides or confuses."""
    inputs = bench.inputs
    out: list[tuple[str, set[str]]] = []
    rising, falling, rates, held, pulled = 0.0, 0.0, [], 0.0, set()
    top = max(float(np.abs(i.command).max()) for i in inputs)
    for i in inputs:
        change = np.diff(i.command, axis=0)
        rising += float(np.maximum(change, 0.0).sum())
        falling += float(np.maximum(-change, 0.0).sum())
        length = float(i.time[-1] - i.time[0])
        if length > 0.0:
            rates.append(float(np.abs(change).sum()) / length)
        still = np.abs(change).max(axis=1) < 0.02 * top
        held = max(held, _longest(still, i.time))
        pulled |= {int(t) for t in np.flatnonzero(np.ptp(i.command, axis=0) > 0.2 * top)}
    if min(rising, falling) < 0.2 * max(rising, falling):
        out.append(("loading and unloading", {"tendon_friction", "tendon_backlash", "backbone_creep", "actuator_saturation"}))
    moving = [r for r in rates if r > 0.05 * max(rates)]
    if len(moving) < 2 or max(moving) < FAST**0.5 * min(moving):
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
        out.append(("a random order of the trials", {"load_cell_drift", "temperature_softening", "backbone_creep"}))
    return out


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
    """Whether payloads come in blocks: fewer changes from trial to trial than half of what chance would give."""
    loads = [i.loads.payload for i in bench.inputs]
    counts = np.array([loads.count(x) for x in set(loads)])
    if len(counts) < 2:
        return False
    n = len(loads)
    expected = (n - 1) * (1.0 - float((counts * (counts - 1)).sum()) / (n * (n - 1)))
    return sum(a != b for a, b in pairwise(loads)) < 0.5 * expected
