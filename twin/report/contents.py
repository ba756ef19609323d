"""report.json, for other programs. Its keys and units are a contract (`twin-report/1`); positions are in mm."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from twin.diagnosis import Claim, Diagnosis
from twin.diagnosis.checks.identifiability import Visibility
from twin.foundation.display_names import display_name
from twin.foundation.parameters import FittedValue
from twin.prediction.evaluate import OUTPUT_GROUPS
from twin.report.hand_check import all_notices, hand_check
from twin.report.numbers import DISPLAY_UNITS, finite_or_none
from twin.report.plots.loops import advise_repeat, loops_json
from twin.report.sentence import describe_errors, describe_verdict, headline_group, output_groups, remaining_structure, trial_labels

REPORT_FORMAT = "twin-report/1"


def contents(diagnosis: Diagnosis, provenance: Mapping[str, Any]) -> dict[str, Any]:
    """Return the report in JSON types: plain floats, None where there is no number. Parameters are SI."""
    d = diagnosis
    left = remaining_structure(d)
    _, factor = DISPLAY_UNITS[headline_group(d)]
    return {
        "format": REPORT_FORMAT,
        "verdict": d.verdict,
        "summary": describe_verdict(d),
        "suspicions": [{"kind": s.kind, "words": s.words, "change": s.change} for s in d.suspicions],
        "effects": [
            {
                "id": c.effect,
                "parameters": _parameters(c.parameters),
                "error_without": finite_or_none(c.error, factor),
                **_weight(c),
            }
            for c in d.claims
        ],
        "candidates": [
            {"id": c.effect, "error": finite_or_none(c.error, factor), "parameters": _parameters(c.parameters), **_weight(c)}
            for c in d.runners_up
        ],
        "error": _error(d),
        "residual": {
            "structure": left or "none",
            "worst_channel": d.worst_channel,
            "correlates_with": [name for name, _ in d.strongest] if left else [],
            "description": d.description,
            "before": finite_or_none(d.structure_before),
            "after": finite_or_none(d.structure_after),
            "components": {name: finite_or_none(size) for name, size in d.structure.items()},
        },
        "loops": loops_json(d.loops, trial_labels(d, tuple(loop.trial for loop in d.loops.by_trial))),
        "ambiguous": [list(effects) for effects in d.ambiguous],
        "next_experiment": describe_experiment(d),
        "identifiability": [_visibility(v) for v in d.identifiability],
        "below_materiality": [
            {"id": c.effect, "parameters": _parameters(c.parameters), "contribution": finite_or_none(c.contribution)}
            for c in d.below_materiality
        ],
        "parameters": _parameters(d.parameters),
        "unfixed": list(d.unfixed),
        "correlation": _correlation(*d.correlation),
        "noise": _noise(d),
        "under_hand": _under_hand(d),
        "notices": list(all_notices(d)),
        "source": d.prepared.recording.source,
        "title": d.prepared.recording.title,
        "provenance": dict(provenance),
    }


def describe_experiment(diagnosis: Diagnosis) -> str | None:
    """Describe the next experiment; None where none is needed or none would decide."""
    e, advice = diagnosis.experiment, advise_repeat(diagnosis)
    if e is None:
        return advice
    runs = "one run separates" if e.repeats == 1 else f"{e.repeats} runs together separate"
    one, other = (" + ".join(map(display_name, names)) or "no effect" for names in e.between)
    words = f"{e.words}: {runs} {one} from {other} by {(e.separation * e.repeats) ** 0.5:.0f} standard errors"
    return f"{words}; and {advice}" if advice else words


def _weight(claim: Claim) -> dict[str, float | None]:
    return {"probability": finite_or_none(claim.probability), "contribution": finite_or_none(claim.contribution)}


def _visibility(v: Visibility) -> dict[str, Any]:
    """Return amplitudes in sigmas; None where the design never shows the effect or never distinguishes it."""
    name, value, unit = v.smallest
    return {
        "id": v.effect,
        "form": v.form or None,
        "seen": finite_or_none(v.seen),
        "apart": finite_or_none(v.apart),
        "share": finite_or_none(v.share),
        "rival": v.rival or None,
        "smallest": {"parameter": name, "value": finite_or_none(value), "unit": unit},
        "lacking": list(v.lacking),
    }


def _correlation(names: Sequence[str], matrix: np.ndarray) -> dict[str, Any]:
    """Return the correlation of the errors of fitted parameters."""
    return {"parameters": list(names), "matrix": [[finite_or_none(float(x)) for x in row] for row in matrix]}


def _under_hand(d: Diagnosis) -> dict[str, Any] | None:
    """Return sensor strain minus strain of the measured shape, for each sensor; None where no trial allows it."""
    check = hand_check(d)
    if check is None:
        return None
    each = {"calibrated": check.rms_before, "after": check.rms_after, "seen_std": check.strain_error}
    return {
        "trials": list(check.trials), "frames": check.frames, "unit": "strain",
        **{name: [finite_or_none(float(x)) for x in values] for name, values in each.items()},
    }  # fmt: skip


def _parameters(parameters: Mapping[str, FittedValue]) -> dict[str, dict[str, Any]]:
    return {n: {"value": finite_or_none(f.value), "std": finite_or_none(f.std), "unit": f.unit} for n, f in parameters.items()}


def _error(d: Diagnosis) -> dict[str, Any]:
    out = {"split": "held-out trials", "trials": trial_labels(d, d.held_out_trials), **_of_group(d, headline_group(d))}
    out |= {"summary": describe_errors(d), "no_equilibrium": trial_labels(d, d.errors.lost), "left_out": list(d.errors.spikes)}
    if d.folds:
        out["folds"] = [
            {"trial": trial_labels(d, (f.trial,))[0], "verdict": f.verdict, "effects": list(f.effects)} for f in d.folds
        ]
    if len(output_groups(d)) > 1:
        out["by_kind"] = {OUTPUT_GROUPS[g].kind: _of_group(d, g) for g in output_groups(d)}
    return out


def _of_group(d: Diagnosis, group: str) -> dict[str, Any]:
    e = d.errors
    unit, factor = DISPLAY_UNITS[group]
    return {
        "unit": unit,
        "nominal": finite_or_none(e.nominal[group], factor),
        "calibrated": finite_or_none(e.calibrated[group], factor),
        "after": finite_or_none(e.after[group], factor),
        "ci95": {
            "calibrated": [finite_or_none(x, factor) for x in e.ci_calibrated[group]],
            "after": [finite_or_none(x, factor) for x in e.ci_after[group]],
        },
        "noise_floor": finite_or_none(e.floor[group], factor),
    }


def _noise(d: Diagnosis) -> dict[str, Any]:
    outputs = d.prepared.outputs
    return {
        "source": d.noise.source,
        "inputs": {
            c.name: {"sigma": finite_or_none(float(s), DISPLAY_UNITS[of][1]), "unit": DISPLAY_UNITS[of][0]}
            for c, s, of in zip(d.prepared.drivers, d.noise.drive, d.prepared.drives, strict=True)
        },
        "channels": {
            o.channel.name: {
                "sigma": finite_or_none(float(s), DISPLAY_UNITS[o.group][1]), "unit": DISPLAY_UNITS[o.group][0],
                "correlation": finite_or_none(float(r)),
            }
            for o, s, r in zip(outputs, d.noise.sigma, d.noise.rho, strict=True)
        },
    }  # fmt: skip
