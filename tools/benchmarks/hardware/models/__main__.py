"""Robots that have an MJCF, from public logs: python -m tools.benchmarks.hardware.models FOLDER OUT [rig ...]

FOLDER holds the raw data, one folder a rig (xl330-pendulum, go2-legs, aero-hand). Sets, reports and better models go to OUT/<rig>.
"""

import importlib
import time
from pathlib import Path

import tyro

from twin import report
from twin.diagnosis import Settings, diagnose
from twin.measurements import read
from twin.prediction.twin import Twin

RIGS = {"xl330": "xl330-pendulum", "go2_legs": "go2-legs", "aero_hand": "aero-hand"}  # module -> folder of the raw data


def main(
    folder: tyro.conf.Positional[Path], out: tyro.conf.Positional[Path], rigs: tyro.conf.Positional[tuple[str, ...]] = tuple(RIGS)
) -> None:
    """Write sets, diagnose the fitted one, judge the twin on the other.

    Args:
        folder: raw data, one folder a rig
        out: folder for sets and reports
        rigs: modules beside this one
    """
    for rig in rigs:
        module = importlib.import_module(f"tools.benchmarks.hardware.models.{rig}")
        fitted, judged = module.write_sets(folder / RIGS[rig], out / rig)
        recording, began = read(fitted), time.process_time()
        settings = Settings(jobs=1)
        found = diagnose(recording, settings=settings, progress=lambda words, rig=rig: print(rig, words, flush=True))
        print(f"{rig}: {time.process_time() - began:.0f} s of a core; {found.summary()}")
        for claim in found.claims:
            numbers = ", ".join(f"{n} = {v.value:.4g} +- {v.std or float('nan'):.2g} {v.unit}" for n, v in claim.parameters.items())
            print(f"  {claim.effect} ({claim.probability:.3f}): {numbers}")
        print("  runners-up:", ", ".join(f"{c.effect} {c.probability:.3f}" for c in found.runners_up))
        print(" ", module.judge(found.twin, Twin.of_recording(recording), read(judged, least_trials=1)))
        report.write(found, out / rig / "report", report.provenance(recording, settings, f"tools.benchmarks.hardware.models {rig}"))


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
