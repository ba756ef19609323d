"""What is left, in words, so that an engineer knows where to look: channel, frequency, what it moves with, since when, and the
known effect that comes nearest.

All from whitened residuals of the fitted trials, (n, m) in sigmas: noise alone is 1.
"""

from collections.abc import Sequence

import numpy as np

from twin.diagnosis.checks.mixed_robots import MixedRobots
from twin.diagnosis.evidence.discrepancy import COMPONENTS, IN_WORDS, Discrepancy
from twin.diagnosis.evidence.null_distribution import AcceptanceLimits
from twin.diagnosis.explain.error_location import place
from twin.diagnosis.thresholds import HINT_SHARE, SHUFFLED_ORDERS, STEP_LEFTOVER_SHARE, TRIALS_NAMED
from twin.foundation.display_names import display_name
from twin.prediction.prepared import PreparedRecording


def components(discrepancy: Discrepancy) -> dict[str, float]:
    """RMS (sigmas) of the left-over smooth error by component, over all channels."""
    return {c: float(np.sqrt(np.mean(v))) for c, v in zip(COMPONENTS, discrepancy.variance.T, strict=True)}


def worst_channel(prepared: PreparedRecording, z: np.ndarray) -> str:
    """The channel of the largest residual."""
    return prepared.outputs[int(np.argmax((z**2).mean(axis=0)))].channel.name


def structure(
    prepared: PreparedRecording,
    trials: Sequence[int],
    z: np.ndarray,
    discrepancy: Discrepancy,
    strongest: str,
    line: tuple[float, float],
    limits: AcceptanceLimits,
) -> str:
    """The residual z (n, m) of a twin that leaves structure, with its strongest regressor and its line (z-score, Hz)."""
    parts = components(discrepancy)
    main = max(parts, key=lambda c: parts[c])
    words = []
    if discrepancy.size > limits.left or line[0] <= limits.faint:
        words.append(f"A smooth part of {discrepancy.size:.2f} sigma is left, largest in {worst_channel(prepared, z)}")
        words[-1] += _and(place(prepared, discrepancy.mean))
        words.append(f"It moves mostly with {IN_WORDS[main]} ({parts[main]:.2f} sigma), strongest with {strongest!r}")
    if line[0] > limits.faint:
        swing = wave(prepared, trials, z - discrepancy.mean, line[1])
        size = float(np.sqrt(2.0 * (swing**2).mean(axis=0).max()))
        words.append(f"A line at {line[1]:.2f} Hz is left, of {size:.1f} sigma in {worst_channel(prepared, swing)}")
        words[-1] += _and(place(prepared, swing))
    return ". ".join(words) + "."


def since(prepared: PreparedRecording, trials: Sequence[int], z: np.ndarray) -> str:
    """When the residual z (n, m) of the calibrated robot changed at once, in words; "" if it did not.

    Calibrated, without effects: no known law steps once in a session, but several together may be bent into one.
    """
    began = change(prepared, trials, z)
    if began is None:
        return ""
    label = {t.name: t.label for t in prepared.recording.trials}
    last, first = (prepared.inputs[k] for k in began)
    start = prepared.inputs[0].clock[0]
    minutes = f"{(last.clock[-1] - start) / 60:.0f} to {(first.clock[0] - start) / 60:.0f} min into the session"
    between = f"between {label[last.name]} and {label[first.name]}, {minutes}"
    return f" The calibrated robot's error changed at once {between}: what moved then?"


def mixed(prepared: PreparedRecording, rigs: MixedRobots) -> str:
    """Two rigs' data in one set, in words."""
    label = {t.name: t.label for t in prepared.recording.trials}
    few = ", ".join(label[prepared.inputs[k].name] for k in rigs.other[:TRIALS_NAMED])
    more = f" and {len(rigs.other) - TRIALS_NAMED} more" if len(rigs.other) > TRIALS_NAMED else ""
    return (
        f" The trials want two different robots, {len(rigs.one)} the one, {len(rigs.other)} the other ({few}{more}), more than "
        "any known effect: are two rigs in this set, or was it rebuilt? Diagnose the two groups apart."
    )


def unlike(unseen: float, seen: float) -> str:
    """The smooth error (sigma) on trials left out of the fit in turn, beside that on trials it has."""
    return (
        f" On trials left out of the fit in turn a smooth error of {unseen:.2f} sigma is left, on the others {seen:.2f}: "
        "what was found does not hold there."
    )


def nearest(effects: Sequence[str], share: float) -> str:
    """A hint: the best known explanation that was not claimed, and the share it takes off the error left out; "" if little."""
    if not share > HINT_SHARE:
        return ""
    names = " with ".join(display_name(e) for e in effects)
    return f" Of the known effects {names} comes nearest, but takes only {100 * share:.0f} % off the error on trials left out."


def _and(words: str) -> str:
    return f"; {words}" if words else ""


def wave(prepared: PreparedRecording, trials: Sequence[int], x: np.ndarray, frequency: float) -> np.ndarray:
    """The part of x (n, m) that swings with `frequency` (Hz), its phase free in every trial."""
    out, row = np.empty_like(x), 0
    for k in trials:
        turn = 2.0 * np.pi * frequency * prepared.inputs[k].time
        basis = np.stack([np.cos(turn), np.sin(turn)], axis=1)
        rows = slice(row, row + len(turn))
        out[rows] = basis @ np.linalg.lstsq(basis, x[rows], rcond=None)[0]
        row = rows.stop
    return out


def change(prepared: PreparedRecording, trials: Sequence[int], z: np.ndarray) -> tuple[int, int] | None:
    """The two neighbouring trials between which the mean residual steps; None where it drifts, scatters or stays.

    With M_k the mean of trial k (m,) less that of all K, a step after trial k explains K / (k (K - k)) |M_1 + ... + M_k|^2.
    The trials' order is what a step needs and scatter does not: the largest such sum must exceed that of every shuffled order.
    """
    if len(trials) < 4:
        return None
    ends = np.cumsum([len(prepared.inputs[k].time) for k in trials])
    M = np.stack([part.mean(axis=0) for part in np.split(z, ends[:-1])])
    M -= M.mean(axis=0)
    K = len(M)
    after = np.arange(2, K - 1)  # two trials at least on either side: one alone is that trial's
    orders = np.random.default_rng(0).permuted(np.tile(np.arange(K), (SHUFFLED_ORDERS, 1)), axis=1)

    def explained(rows: np.ndarray) -> np.ndarray:
        return (np.cumsum(rows, axis=-2)[..., after - 1, :] ** 2).sum(axis=-1) * K / (after * (K - after))

    steps = explained(M)
    best = int(np.argmax(steps))
    by_chance = max(float(explained(M[order]).max()) for order in orders)
    t = np.array([prepared.inputs[k].clock[0] for k in trials])
    t = (t - t.mean()) / np.linalg.norm(t - t.mean())
    scatter, drift = float((M**2).sum()), float(((t @ M) ** 2).sum())
    if steps[best] <= max(by_chance, (1.0 - STEP_LEFTOVER_SHARE) * scatter, drift):
        return None
    return trials[after[best] - 1], trials[after[best]]


def doubtful(effects: Sequence[str]) -> str:
    """Of claims less likely than not."""
    named = " and ".join(display_name(e) for e in effects)
    return (
        f"{named}: less likely than not, for other sets of effects have more evidence; what all of them imitate may be none of them"
    )


def undecided(effect: str, rival: str) -> str:
    """An effect that was found, and is not claimed because these data cannot tell it from another."""
    one, other = (display_name(e) for e in (effect, rival))
    return f" {one.capitalize()} or {other} would explain more, but these data cannot tell which: neither is claimed."
