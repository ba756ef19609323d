"""What is left, in words, so that an engineer knows where to look: channel, place along the body, frequency, what it moves with,
since when, and the known effect that comes nearest.

All from whitened residuals of the fitted trials, (n, m) in sigmas: noise alone is 1.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twin.bench import Bench
from twin.diagnose.evidence import COMPONENTS, IN_WORDS, Discrepancy
from twin.diagnose.null import Thresholds

ALIKE = 1.5  # ratio of the largest marker error to the smallest that counts as none
ALONE = 0.6  # of the summed squares: one marker carries it (an error that grows with the square of the arc length: 0.48 at the tip)
SUDDEN = 0.5  # of the rise along the body that happens between two neighbours: it sets in there
SHUFFLES = 999  # orders of the trials of which none may show so clear a step: one chance in a thousand
STEP = 0.2  # of the trials' scatter a step in time may leave; of a steady drift the best step leaves a quarter
NEAR = 0.1  # of the held-out error a known effect must take off to be worth a hint


def components(discrepancy: Discrepancy) -> dict[str, float]:
    """RMS (sigmas) of the left-over smooth error by component, over all channels."""
    return {c: float(np.sqrt(np.mean(v))) for c, v in zip(COMPONENTS, discrepancy.variance.T, strict=True)}


def worst_channel(bench: Bench, z: np.ndarray) -> str:
    """The channel of the largest residual."""
    return bench.outputs[int(np.argmax((z**2).mean(axis=0)))].channel.name


def describe(
    bench: Bench,
    trials: Sequence[int],
    z: np.ndarray,
    discrepancy: Discrepancy,
    strongest: str,
    line: tuple[float, float],
    bars: Thresholds,
) -> str:
    """The residual z (n, m) of a twin that leaves structure, with its strongest regressor and its line (z-score, Hz)."""
    parts = components(discrepancy)
    main = max(parts, key=lambda c: parts[c])
    words = []
    if discrepancy.size > bars.left or line[0] <= bars.line:
        words.append(f"A smooth part of {discrepancy.size:.2f} sigma is left, largest in {worst_channel(bench, z)}")
        words[-1] += _and(place(bench, discrepancy.mean))
        words.append(f"It moves mostly with {IN_WORDS[main]} ({parts[main]:.2f} sigma), strongest with {strongest!r}")
    if line[0] > bars.line:
        swing = wave(bench, trials, z - discrepancy.mean, line[1])
        size = float(np.sqrt(2.0 * (swing**2).mean(axis=0).max()))
        words.append(f"A line at {line[1]:.2f} Hz is left, of {size:.1f} sigma in {worst_channel(bench, swing)}")
        words[-1] += _and(place(bench, swing))
    return ". ".join(words) + "."


def since(bench: Bench, trials: Sequence[int], z: np.ndarray) -> str:
    """When the residual z (n, m) of the calibrated robot changed at once, in words; "" if it did not.

    Calibrated, without effects: no known law steps once in a session, but several together may be bent into one.
    """
    began = change(bench, trials, z)
    if began is None:
        return ""
    label = {t.name: t.label for t in bench.recording.trials}
    last, first = (bench.inputs[k] for k in began)
    start = bench.inputs[0].clock[0]
    minutes = f"{(last.clock[-1] - start) / 60:.0f} to {(first.clock[0] - start) / 60:.0f} min into the session"
    between = f"between {label[last.name]} and {label[first.name]}, {minutes}"
    return f" The calibrated robot's error changed at once {between}: what moved then?"


def nearest(effects: Sequence[str], share: float) -> str:
    """A hint: the best known explanation that was not claimed, and the share of the held-out error it takes off; "" if little."""
    if not share > NEAR:
        return ""
    names = " with ".join(e.replace("_", " ") for e in effects)
    return f" Of the known effects {names} comes nearest, but takes only {100 * share:.0f} % off the held-out error."


def _and(words: str) -> str:
    return f"; {words}" if words else ""


def place(bench: Bench, x: np.ndarray) -> str:
    """Which markers carry an error x (n, m), in words; "" with fewer than three of them."""
    columns: dict[int, list[int]] = {}
    for j, o in enumerate(bench.outputs):
        if o.group == "marker":
            columns.setdefault(o.index, []).append(j)
    if len(columns) < 3:
        return ""
    order = [columns[i] for i in sorted(columns)]  # base to tip
    names = [bench.outputs[c[0]].channel.name.rpartition("_")[0] for c in order]
    size = np.array([np.sqrt((x[:, c] ** 2).mean()) for c in order])
    most = int(np.argmax(size))
    if size[most] < ALIKE * size.min():
        return "it is alike along the body"
    if size[most] ** 2 > ALONE * (size**2).sum():
        return f"{names[most]} alone carries most of it: check that marker"
    rise = np.diff(size)
    sudden = int(np.argmax(rise))
    if rise[sudden] > SUDDEN * (size.max() - size.min()):
        return f"it sets in between {names[sudden]} and {names[sudden + 1]}"
    return f"it grows from {names[0]} to {names[-1]}" if size[-1] > size[0] else f"it fades from {names[0]} to {names[-1]}"


def wave(bench: Bench, trials: Sequence[int], x: np.ndarray, frequency: float) -> np.ndarray:
    """The part of x (n, m) that swings with `frequency` (Hz), its phase free in every trial."""
    out, row = np.empty_like(x), 0
    for k in trials:
        turn = 2.0 * np.pi * frequency * bench.inputs[k].time
        basis = np.stack([np.cos(turn), np.sin(turn)], axis=1)
        rows = slice(row, row + len(turn))
        out[rows] = basis @ np.linalg.lstsq(basis, x[rows], rcond=None)[0]
        row = rows.stop
    return out


def change(bench: Bench, trials: Sequence[int], z: np.ndarray) -> tuple[int, int] | None:
    """The two neighbouring trials between which the mean residual steps; None where it drifts, scatters or stays.

    With M_k the mean of trial k (m,) less that of all K, a step after trial k explains K / (k (K - k)) |M_1 + ... + M_k|^2.
    The trials' order is what a step needs and scatter does not: the largest such sum must exceed that of every shuffled order.
    """
    if len(trials) < 4:
        return None
    ends = np.cumsum([len(bench.inputs[k].time) for k in trials])
    M = np.stack([part.mean(axis=0) for part in np.split(z, ends[:-1])])
    M -= M.mean(axis=0)
    K = len(M)
    after = np.arange(2, K - 1)  # two trials at least on either side: one alone is that trial's
    orders = np.random.default_rng(0).permuted(np.tile(np.arange(K), (SHUFFLES, 1)), axis=1)

    def explained(rows: np.ndarray) -> np.ndarray:
        return (np.cumsum(rows, axis=-2)[..., after - 1, :] ** 2).sum(axis=-1) * K / (after * (K - after))

    steps = explained(M)
    best = int(np.argmax(steps))
    by_chance = max(float(explained(M[order]).max()) for order in orders)
    t = np.array([bench.inputs[k].clock[0] for k in trials])
    t = (t - t.mean()) / np.linalg.norm(t - t.mean())
    scatter, drift = float((M**2).sum()), float(((t @ M) ** 2).sum())
    if steps[best] <= max(by_chance, (1.0 - STEP) * scatter, drift):
        return None
    return trials[after[best] - 1], trials[after[best]]
