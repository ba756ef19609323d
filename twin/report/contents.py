"""report.json: what other programs read. Its keys and units are a contract (`twin-report/1`); positions are in mm."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from twin.diagnose import Claim, Diagnosis
from twin.diagnose.identifiability import Visibility
from twin.evaluate import KIND
from twin.quantities import Fitted
from twin.report.loops import advice, table
from twin.report.numbers import SHOWN, finite
from twin.report.sentence import error_words, groups, headline, labels, structure_left, verdict_words
from twin.wording import in_words

FORMAT = "twin-report/1"


def contents(diagnosis: Diagnosis, provenance: Mapping[str, Any]) -> dict[str, Any]:
    """The report as JSON's own types: plain floats, None where there is no number. Effects' and robot's parameters are SI."""
    d = diagnosis
    left = structure_left(d)
    _, factor = SHOWN[headline(d)]
    return {
        "format": FORMAT,
        "verdict": d.verdict,
        "summary": verdict_words(d),
        "suspicions": [{"kind": s.kind, "words": s.words, "change": s.change} for s in d.suspicions],
        "effects": [
            {"id": c.effect, "parameters": _parameters(c.parameters), "error_without": finite(c.error, factor), **_weight(c)}
            for c in d.claims
        ],
        "candidates": [
            {"id": c.effect, "error": finite(c.error, factor), "parameters": _parameters(c.parameters), **_weight(c)}
            for c in d.runners_up
        ],
        "error": _error(d),
        "residual": {
            "structure": left or "none",
            "worst_channel": d.worst_channel,
            "correlates_with": [name for name, _ in d.strongest] if left else [],
            "description": d.description,
            "before": finite(d.structure_before),
            "after": finite(d.structure_after),
            "components": {name: finite(size) for name, size in d.structure.items()},
        },
        "loops": table(d.loops, labels(d, tuple(loop.trial for loop in d.loops.each))),
        "ambiguous": [list(effects) for effects in d.ambiguous],
        "next_experiment": experiment_words(d),
        "identifiability": [_visibility(v) for v in d.identifiability],
        "below_materiality": [
            {"id": c.effect, "parameters": _parameters(c.parameters), "contribution": finite(c.contribution)}
            for c in d.below_materiality
        ],
        "parameters": _parameters(d.parameters),
        "unfixed": list(d.unfixed),
        "correlation": _correlation(*d.correlation),
        "noise": _noise(d),
        "under_hand": _under_hand(d),
        "notices": list(d.notices),
        "source": d.bench.recording.source,
        "title": d.bench.recording.title,
        "provenance": dict(provenance),
    }


def experiment_words(diagnosis: Diagnosis) -> str | None:
    """The next experiment in words and numbers; None where none is needed or none would settle the doubt."""
    e, asked = diagnosis.experiment, advice(diagnosis)
    if e is None:
        return asked
    runs = "one run separates" if e.repeats == 1 else f"{e.repeats} runs together separate"
    one, other = (" + ".join(map(in_words, names)) or "no effect" for names in e.between)
    words = f"{e.words}: {runs} {one} from {other} by {(e.separation * e.repeats) ** 0.5:.0f} standard errors"
    return f"{words}; and {asked}" if asked else words


def _weight(claim: Claim) -> dict[str, float | None]:
    return {"probability": finite(claim.probability), "contribution": finite(claim.contribution)}


def _visibility(v: Visibility) -> dict[str, Any]:
    """Amplitudes in sigmas, None where the design never shows the effect or never tells it apart."""
    name, value, unit = v.smallest
    return {
        "id": v.effect,
        "form": v.form or None,
        "seen": finite(v.seen),
        "apart": finite(v.apart),
        "share": finite(v.share),
        "rival": v.rival or None,
        "smallest": {"parameter": name, "value": finite(value), "unit": unit},
        "lacking": list(v.lacking),
    }


def _correlation(names: Sequence[str], of: np.ndarray) -> dict[str, Any]:
    """How the errors of fitted parameters go together, rows and columns as named."""
    return {"parameters": list(names), "matrix": [[finite(float(x)) for x in row] for row in of]}


def _under_hand(d: Diagnosis) -> dict[str, Any] | None:
    """Strains felt less those of the shapes seen, a number a sensor; None where no trial has a hand on a robot that is seen."""
    seen = d.under_hand
    if seen is None:
        return None
    each = {"calibrated": seen.before, "after": seen.after, "seen_std": seen.seen}
    return {
        "trials": list(seen.trials), "frames": seen.frames, "unit": "strain",
        **{name: [finite(float(x)) for x in values] for name, values in each.items()},
    }  # fmt: skip


def _parameters(parameters: Mapping[str, Fitted]) -> dict[str, dict[str, Any]]:
    return {n: {"value": finite(f.value), "std": finite(f.std), "unit": f.unit} for n, f in parameters.items()}


def _error(d: Diagnosis) -> dict[str, Any]:
    out = {"split": "held-out trials", "trials": labels(d, d.sealed_trials), **_of_group(d, headline(d))}
    out |= {"summary": error_words(d), "no_equilibrium": labels(d, d.errors.lost), "left_out": list(d.errors.spikes)}
    if d.folds:
        out["folds"] = [{"trial": labels(d, (f.trial,))[0], "verdict": f.verdict, "effects": list(f.effects)} for f in d.folds]
    if len(groups(d)) > 1:
        out["by_kind"] = {KIND[g]: _of_group(d, g) for g in groups(d)}
    return out


def _of_group(d: Diagnosis, group: str) -> dict[str, Any]:
    e = d.errors
    unit, factor = SHOWN[group]
    return {
        "unit": unit,
        "nominal": finite(e.nominal[group], factor),
        "calibrated": finite(e.calibrated[group], factor),
        "after": finite(e.after[group], factor),
        "ci95": {
            "calibrated": [finite(x, factor) for x in e.ci_calibrated[group]],
            "after": [finite(x, factor) for x in e.ci_after[group]],
        },
        "noise_floor": finite(e.floor[group], factor),
    }


def _noise(d: Diagnosis) -> dict[str, Any]:
    outputs = d.bench.outputs
    return {
        "source": d.noise.source,
        "inputs": {
            c.name: {"sigma": finite(float(s), SHOWN[of][1]), "unit": SHOWN[of][0]}
            for c, s, of in zip(d.bench.drivers, d.noise.drive, d.bench.drives, strict=True)
        },
        "channels": {
            o.channel.name: {
                "sigma": finite(float(s), SHOWN[o.group][1]), "unit": SHOWN[o.group][0], "correlation": finite(float(r)),
            }
            for o, s, r in zip(outputs, d.noise.sigma, d.noise.rho, strict=True)
        },
    }  # fmt: skip
