"""What is left, in words: channel, frequency, what it moves with, when it began, and the nearest known effect.

All from whitened residuals of the fitted trials, (n, m) in sigmas: noise alone is 1.
"""

from collections.abc import Sequence

import numpy as np

from twin.diagnosis.checks.mixed_robots import MixedRobots
from twin.diagnosis.evidence.discrepancy import COMPONENTS, IN_WORDS, Discrepancy
from twin.diagnosis.evidence.null_distribution import AcceptanceLimits
from twin.diagnosis.explain.error_location import place
from twin.diagnosis.thresholds import HINT_SHARE, NAMED_ONE_BY_ONE, SHUFFLED_ORDERS, STEP_LEFTOVER_SHARE
from twin.foundation.display_names import display_name
from twin.prediction.prepared import PreparedRecording


def components(discrepancy: Discrepancy) -> dict[str, float]:
    """Return the RMS (sigmas) of the residual smooth error by component, over all channels."""
    return {c: float(np.sqrt(np.mean(v))) for c, v in zip(COMPONENTS, discrepancy.variance.T, strict=True)}


def worst_channel(prepared: PreparedRecording, z: np.ndarray) -> str:
    """Return the channel with the largest residual."""
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
    """Describe the residual z (n, m) of a twin that leaves structure.

    `strongest`: its strongest regressor. `line`: its strongest spectral line (z-score, Hz).
    """
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
    """Return when the residual z (n, m) of the calibrated robot changed in one step, in words; "" if it did not.

    The robot is calibrated without effects: no known effect steps once in a session, but several together may imitate a step.
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
    """Describe two robots' data in one set."""
    label = {t.name: t.label for t in prepared.recording.trials}
    few = ", ".join(label[prepared.inputs[k].name] for k in rigs.other[:NAMED_ONE_BY_ONE])
    more = f" and {len(rigs.other) - NAMED_ONE_BY_ONE} more" if len(rigs.other) > NAMED_ONE_BY_ONE else ""
    return (
        f" The trials fit two different robots, {len(rigs.one)} the one, {len(rigs.other)} the other ({few}{more}), better than "
        "any known effect: does this set mix two robots, or was the robot rebuilt? Diagnose the two groups apart."
    )


def unlike(unseen: float, seen: float) -> str:
    """Compare the smooth error (sigma) on left-out trials with that on fitted ones."""
    return (
        f" On left-out trials a smooth error of {unseen:.2f} sigma is left, on fitted ones {seen:.2f}: "
        "what was found does not hold there."
    )


def nearest(effects: Sequence[str], share: float) -> str:
    """Return a hint: the best known explanation that was not claimed, and the share of the left-out error that it explains.

    "" if the share is small.
    """
    if not share > HINT_SHARE:
        return ""
    names = " with ".join(display_name(e) for e in effects)
    return f" Of the known effects {names} comes nearest, but explains only {100 * share:.0f} % of the error on left-out trials."


def _and(words: str) -> str:
    return f"; {words}" if words else ""


def wave(prepared: PreparedRecording, trials: Sequence[int], x: np.ndarray, frequency: float) -> np.ndarray:
    """Return the part of x (n, m) that oscillates with `frequency` (Hz), its phase free in every trial."""
    out, row = np.empty_like(x), 0
    for k in trials:
        turn = 2.0 * np.pi * frequency * prepared.inputs[k].time
        basis = np.stack([np.cos(turn), np.sin(turn)], axis=1)
        rows = slice(row, row + len(turn))
        out[rows] = basis @ np.linalg.lstsq(basis, x[rows], rcond=None)[0]
        row = rows.stop
    return out


def change(prepared: PreparedRecording, trials: Sequence[int], z: np.ndarray) -> tuple[int, int] | None:
    """Return the two neighbouring trials between which the mean residual steps; None where it drifts, scatters or stays.

    With M_k the mean of trial k (m,) less that of all K, a step after trial k explains K / (k (K - k)) |M_1 + ... + M_k|^2. A step
    depends on the order of the trials and scatter does not: the largest such sum must exceed that of every shuffled order.
    """
    if len(trials) < 4:
        return None
    ends = np.cumsum([len(prepared.inputs[k].time) for k in trials])
    M = np.stack([part.mean(axis=0) for part in np.split(z, ends[:-1])])
    M -= M.mean(axis=0)
    K = len(M)
    after = np.arange(2, K - 1)  # at least two trials on either side: one alone is an outlier
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
    """Describe claims less likely than not."""
    named = " and ".join(display_name(e) for e in effects)
    return f"{named}: less likely than not, since other sets of effects have more evidence; the true cause may be none of them"


def undecided(effect: str, rival: str) -> str:
    """Describe an effect that was found, and is not claimed because these data cannot separate it from another."""
    one, other = (display_name(e) for e in (effect, rival))
    return f" {one.capitalize()} or {other} would explain more, but these data cannot tell which: neither is claimed."
