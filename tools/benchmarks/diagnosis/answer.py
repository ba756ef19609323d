"""What a diagnosis answers on one measurement set, as a row that can be kept as JSON."""

import time
from pathlib import Path
from typing import Any

from twin.diagnosis import Diagnosis, Settings, diagnose
from twin.foundation.errors import SolveError
from twin.measurements import Recording, read
from twin.prediction.twin import Twin
from twin.robots import load


def diagnosed(recording: Recording, seed: int = 0) -> Diagnosis:
    """Diagnose a set on one core."""
    return diagnose(recording, Twin.of(load(recording.robot, recording.folder)), Settings(seed=seed, jobs=1))


def answer(folder: Path, seed: int) -> tuple[dict[str, Any], Diagnosis | None]:
    """Return the row of a set and its diagnosis. Errors (m) are RMS on held-out trials, of a marker.

    Where no model of the set can be solved the verdict is "no answer", which is wrong in every row of a table that asks for one.
    """
    recording = read(folder)
    began = time.perf_counter()
    try:
        d = diagnosed(recording, seed)
    except SolveError as error:
        return no_answer(error), None
    seconds, errors = time.perf_counter() - began, d.errors
    return {
        "verdict": d.verdict, "claims": [c.effect for c in d.claims], "probability": [c.probability for c in d.claims],
        "contribution": [c.contribution for c in d.claims], "small": [c.effect for c in d.below_materiality],
        "runners_up": [c.effect for c in d.runners_up], "ambiguous": [list(a) for a in d.ambiguous],
        "calibrated": errors.calibrated["marker"], "after": errors.after["marker"], "floor": errors.floor["marker"],
        "structure": [d.structure_before, d.structure_after, d.structure_unseen],
        "line": d.line[0], "seconds": seconds, "samples": d.prepared.n_sample,
        "parameters": {c.effect: {n: [f.value, f.std] for n, f in c.parameters.items()} for c in d.claims},
        "scores": [[list(s), v] for s, v in d.scores[:5]], "description": d.description,
    }, d  # fmt: skip


def no_answer(error: Exception) -> dict[str, Any]:
    """Return the row of a set that was not diagnosed."""
    return {"verdict": "no answer", "claims": [], "probability": [], "small": [], "description": str(error)}


def in_words(row: dict[str, Any]) -> str:
    """Return the verdict and the claims of a row."""
    return f"{row['verdict']} {' + '.join(row['claims']) or '-'}"


def errors_in_words(row: dict[str, Any]) -> str:
    """Return the errors on held-out trials: calibrated / after the effects / noise floor, mm."""
    return " / ".join(f"{1e3 * row[key]:.2f}" for key in ("calibrated", "after", "floor") if key in row)
