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
from twin.diagnose.rigs import Rigs

ALIKE = 1.5  # ratio of the largest marker error to the smallest that counts as none
ALONE = 3.0  # ratio of the largest marker error to the next: that marker alone is off (errors that grow along the body: some 8/7)
TWICE = 2.0  # the square of both jumps at the ends of an interval over that of any other: the bending is wrong there
SHUFFLES = 999  # orders of the trials of which none may show so clear a step: one chance in a thousand
STEP = 0.2  # of the trials' scatter a step in time may leave; of a steady drift the best step leaves a quarter
SHOWN = 6  # trials named one by one
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
    if discrepancy.size > bars.left or line[0] <= bars.faint:
        words.append(f"A smooth part of {discrepancy.size:.2f} sigma is left, largest in {worst_channel(bench, z)}")
        words[-1] += _and(place(bench, discrepancy.mean))
        words.append(f"It moves mostly with {IN_WORDS[main]} ({parts[main]:.2f} sigma), strongest with {strongest!r}")
    if line[0] > bars.faint:
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


def mixed(bench: Bench, rigs: Rigs) -> str:
    """Two rigs' data in one set, in words."""
    label = {t.name: t.label for t in bench.recording.trials}
    few = ", ".join(label[bench.inputs[k].name] for k in rigs.other[:SHOWN])
    more = f" and {len(rigs.other) - SHOWN} more" if len(rigs.other) > SHOWN else ""
    return (
        f" The trials want two different robots, {len(rigs.one)} the one, {len(rigs.other)} the other ({few}{more}), more than "
        "any known effect: are two rigs in this set, or was it rebuilt? Diagnose the two groups apart."
    )


def unlike(unseen: float, seen: float) -> str:
    """The smooth error (sigma) on the trials no fit has seen, beside that on those it has."""
    return (
        f" On the trials that no fit has seen a smooth error of {unseen:.2f} sigma is left, on the others {seen:.2f}: "
        "what was found does not hold there."
    )


def nearest(effects: Sequence[str], share: float) -> str:
    """A hint: the best known explanation that was not claimed, and the share of the held-out error it takes off; "" if little."""
    if not share > NEAR:
        return ""
    names = " with ".join(e.replace("_", " ") for e in effects)
    return f" Of the known effects {names} comes nearest, but takes only {100 * share:.0f} % off the held-out error."


def _and(words: str) -> str:
    return f"; {words}" if words else ""


def _markers(bench: Bench) -> dict[str, list[int]]:
    """Columns of each marker by its name, base to tip, in order of their axes."""
    found: dict[int, list[int]] = {}
    for j, o in enumerate(bench.outputs):
        if o.group == "marker":
            found.setdefault(o.index, []).append(j)
    in_order = (sorted(found[i], key=lambda j: bench.outputs[j].axis) for i in sorted(found))
    return {bench.outputs[c[0]].channel.name.rpartition("_")[0]: c for c in in_order}


def place(bench: Bench, x: np.ndarray) -> str:
    """Which markers carry an error x (n, m), in words; "" with fewer than three of them."""
    columns = _markers(bench)
    if len(columns) < 3:
        return ""
    names = list(columns)
    size = np.array([np.sqrt((x[:, c] ** 2).mean()) for c in columns.values()])
    most = int(np.argmax(size))
    if size[most] < ALIKE * size.min():
        return "it is alike along the body"
    if size[most] > ALONE * np.sort(size)[-2]:
        return f"{names[most]} alone carries most of it: check that marker"
    if most == len(names) - 1:
        return f"it grows from {names[0]} to {names[-1]}"
    return f"it fades from {names[0]} to {names[-1]}" if most == 0 else f"it is largest around {names[most]}"


def where(bench: Bench, trials: Sequence[int], off: np.ndarray, predicted: Sequence[np.ndarray]) -> str:
    """The place that `misbent` finds, in words; "" if there is none."""
    at = misbent(bench, trials, off, predicted)
    if at is None:
        return ""
    if at == 0:
        return " The fitted robot is off from its base on, as a whole: look at the clamp and the camera."
    names = [name for name, c in _markers(bench).items() if len(c) == 3]
    return f" The fitted robot bends wrongly at one place, between {names[at - 1]} and {names[at]}."


def misbent(bench: Bench, trials: Sequence[int], off: np.ndarray, predicted: Sequence[np.ndarray]) -> int | None:
    """The chord, from 0 at the base, in which alone the fitted robot bends wrongly; None if there is no such place.

    `off` (n, m) is the smooth part of its error, `predicted` (n_k, m) where it should be, both SI. A chord t from marker to marker,
    the base the first, turns by w = t x (change of `off` along it) / |t|^2. Bending that is wrong between two markers makes w jump
    at both, whatever the rest of the body does to make up for it.
    """
    whole = {name: c for name, c in _markers(bench).items() if len(c) == 3}
    if len(whole) < 4:
        return None
    columns = list(whole.values())
    seen = np.concatenate([np.isfinite(bench.measured[k][:, columns]).all(axis=(1, 2)) for k in trials])
    t, moved = (_chords(x[:, columns][seen]) for x in (np.concatenate(list(predicted)), off))
    turn = np.cross(t, moved) / (t**2).sum(axis=2, keepdims=True)
    jump = (np.diff(turn, axis=1, prepend=0.0) ** 2).sum(axis=2).mean(axis=0)  # at the base and every marker but the last
    both = np.minimum(jump[:-1], jump[1:])
    at = int(np.argmax(both))
    return at if both[at] > TWICE * np.delete(jump, [at, at + 1]).max() else None


def _chords(x: np.ndarray) -> np.ndarray:
    """Differences (n, marker, 3) from each marker to the next, the first from the base, which is at rest."""
    return np.diff(x, axis=1, prepend=0.0)


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
