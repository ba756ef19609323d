"""Error of estimated finger shapes by estimator, against the truth of bench days that nothing was trained or tuned on.

    python -m tools.simulators.finger --shape --seed 1 --out DIR        a day of the independent finite element bench
    python -m tools.benchmarks.shape.error DIR [DIR ...] [--estimators physics,modal]

For each estimator, with the twin as described and with the twin aligned to the day's clouds: mean distance of the named points (mm)
by trial, the share of points within the 90 % band (1.645 std), the share of frames flagged as unlike all that the estimator knows,
of the others the band's share and the worst frame, and the time a frame takes. --dead 2 cuts sensor 2 off; --silent has nothing
declared that may push; --aligned leaves the twin as described out.
"""

import json
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import tyro

import tools.benchmarks.shape.baselines  # noqa: F401  # adds the baselines to the estimators
from twin.measurements import Recording, read
from twin.prediction.twin import Twin
from twin.robots import load
from twin.shape.alignment.align import Alignment, align
from twin.shape.alignment.band_widening import BandWidening
from twin.shape.estimators.estimator import Z90, estimator_class, estimators
from twin.shape.predict import predict_shapes

SAME_FRAME_TIME = 0.06  # s, within which a frame is the truth's


@dataclass(frozen=True)
class Score:
    """Mean vertex error (mm), the share of points within the band and of frames flagged as outside by trial; the first two shares
    of all frames; the band's share of frames not flagged and the error (mm) of the worst of those; ms a frame."""

    error: dict[str, float]
    inside: dict[str, float]
    outside: dict[str, float]
    covered: float
    flagged: float
    covered_unflagged: float
    worst_unflagged: float
    frame: float


def score(truth: Path, arrays: dict[str, np.ndarray], seconds: float) -> Score:
    true = np.load(truth)
    error, inside, flagged, each = {}, {}, {}, {}
    for name in sorted(k[:-5] for k in true.files if k.startswith("test") and k.endswith("_time")):
        time_of, t = true[f"{name}_time"], arrays[f"{name}_time"]
        at = np.abs(t[None] - time_of[:, None]).argmin(axis=1)
        near = np.abs(t[at] - time_of) < SAME_FRAME_TIME
        places = true[f"{name}_vertices"] * float(true["unit_mm"]) * 1e-3
        away = np.linalg.norm(arrays[f"{name}_vertices"][at] - places, axis=2)[near]
        inside[name] = away <= Z90 * arrays[f"{name}_std"][at][near]
        flagged[name] = arrays[f"{name}_outside"][at][near]
        each[name] = 1e3 * away.mean(axis=1)
        error[name] = 1e3 * float(away.mean())
    frames = sum(len(v) for k, v in arrays.items() if k.endswith("_time"))
    shares, apart = ({name: float(part.mean()) for name, part in parts.items()} for parts in (inside, flagged))
    held, out, off = (np.concatenate(list(parts.values())) for parts in (inside, flagged, each))
    kept, worst = float(held[~out].mean()) if not out.all() else 1.0, float(off[~out].max(initial=0.0))
    return Score(error, shares, apart, float(held.mean()), float(out.mean()), kept, worst, 1e3 * seconds / frames)


def cut(recording: Recording, sensor: int | None) -> Recording:
    """Without what one sensor (from 1) read."""
    if sensor is None:
        return recording
    name = f"sensor_{sensor}_resistance"
    gone = [{name: np.full(len(t.time), np.nan)} for t in recording.trials]
    return recording.with_values(gone, recording.source)


def aligned_error(aligned: Alignment, truth: Path) -> str:
    """Mounting angle off by degrees, R0 and kappa off by per cent (largest)."""
    true, found = json.loads((truth.parent / "truth.json").read_text())["finger"], aligned.fitted
    parts = []
    if "phi_deg" in true:
        parts.append(f"phi {np.rad2deg(found['mounting.angle'].value) - true['phi_deg']:+.2f} deg")
    for key, name in (("R0_ohm", "resistance"), ("kappa_stretch", "stretch"), ("kappa_compression", "compression")):
        values = [found[f"sensors.{name}_{i + 1}"].value / v - 1.0 for i, v in enumerate(true.get(key, []))]
        parts.append(f"{key} {100 * np.abs(values).max():.1f} %" if values else "")
    return ", ".join(parts)


def main(
    days: tyro.conf.Positional[tuple[Path, ...]],
    estimators: str = ",".join(estimators()),
    dead: int | None = None,
    silent: bool = False,
    aligned: bool = False,
) -> None:
    """Print the errors of the estimators (with commas between) on each day."""
    for day in days:
        recording, twin = read(day / "measured"), Twin.of(load("finger"))
        found = align(recording, twin)
        print(f"{day.name}: aligned in {found.seconds:.1f} s; off by {aligned_error(found, day / 'shape_truth.npz')}")
        print(f"  bands widened by {', '.join(f'{n} {by:.2f}' for n, by in found.widening.factors.items())}")
        if silent:
            recording = replace(recording, trials=tuple(replace(t, other={}) for t in recording.trials))
        twins = {"aligned": found.twin} if aligned else {"described": twin, "aligned": found.twin}
        for name in estimators.split(","):
            for label, each in twins.items():
                law, began = estimator_class(name)(each), time.perf_counter()
                arrays, _ = predict_shapes(cut(recording, dead), law, found.widening if label == "aligned" else BandWidening())
                s = score(day / "shape_truth.npz", arrays, time.perf_counter() - began)
                errors = "  ".join(
                    f"{k} {v:.2f} {100 * s.inside[k]:.0f} % ({100 * s.outside[k]:.0f} % flagged)" for k, v in s.error.items()
                )
                mean = float(np.mean(list(s.error.values())))
                print(
                    f"  {name:20s} {label:10s} {mean:6.2f} mm  ({errors})  in band {100 * s.covered:.1f} %  "
                    f"flagged {100 * s.flagged:.1f} %, of the others in band {100 * s.covered_unflagged:.1f} %, worst frame "
                    f"{s.worst_unflagged:.2f} mm  {s.frame:.2f} ms",
                    flush=True,
                )


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
