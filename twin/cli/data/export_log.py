"""The formats of `twin export` that hold a measurement set."""

from collections.abc import Mapping
from pathlib import Path


def export_set(folder: Path, targets: Mapping[str, Path | None], rate: float | None) -> list[Path]:
    """Write the measurement set in `folder` in each format ("mcap", "lerobot", "parquet") that has a target; return those.

    `rate` is that of the frames of LeRobot, 1/s.
    """
    from twin.measurements import read
    from twin.measurements.logs.export import write_lerobot, write_mcap, write_parquet

    writers = {
        "mcap": write_mcap,
        "lerobot": lambda recording, target: write_lerobot(recording, target, rate),
        "parquet": write_parquet,
    }
    asked = {name: target for name, target in targets.items() if target is not None}
    recording = read(folder, least_trials=1) if asked else None
    for name, target in asked.items():
        writers[name](recording, target)
    return list(asked.values())
