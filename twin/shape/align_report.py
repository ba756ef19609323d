"""What an alignment found, on disk: the twin, and a report for people and for programs."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from twin.errors import DataError
from twin.robots.numbers import as_written, spread_as_written
from twin.shape.align import Aligned
from twin.shape.band import Bands
from twin.storage import twin_table, write_twin

TEXT, TABLE = "alignment.txt", "alignment.json"
BANDS, HANDS = "bands_widened_by", "bands_widened_under"


def write_alignment(aligned: Aligned, folder: Path, provenance: Mapping[str, Any]) -> None:
    """Writes twin.toml, alignment.json and alignment.txt to `folder`, made where it is not there; each whole or not at all."""
    folder.mkdir(parents=True, exist_ok=True)
    _write(folder / TABLE, json.dumps(block(aligned), indent=1) + "\n")
    _write(folder / TEXT, "\n".join(lines(aligned)) + "\n")
    write_twin(folder / "twin.toml", twin_table(aligned.twin, folder, aligned.fitted, {}), provenance)


def _write(path: Path, text: str) -> None:
    part = path.with_name(path.name + ".part")
    part.write_text(text, "utf-8")
    part.replace(path)


def bands_of(source: str) -> Bands:
    """Of an aligned twin given by its folder or twin.toml; of others none. Raises DataError for a report that is none."""
    folder = Path(source)
    path = (folder if folder.is_dir() else folder.parent) / TABLE
    if (Path(source).suffix != ".toml" and not folder.is_dir()) or not path.is_file():
        return Bands()
    try:
        found = json.loads(path.read_text("utf-8"))
        by, hands = found.get(BANDS, {}), found.get(HANDS, [])
        return Bands({str(name): float(value) for name, value in by.items()}, tuple(map(str, hands)))
    except (OSError, ValueError, AttributeError, TypeError) as fault:
        raise DataError(f"{path}: no report of an alignment ({type(fault).__name__}); run twin align again, or delete it") from None


def block(aligned: Aligned) -> dict[str, Any]:
    """SI."""
    return {
        "parameters": {n: {"value": f.value, "std": f.std, "unit": f.unit} for n, f in aligned.fitted.items()},
        BANDS: dict(aligned.bands.by),
        HANDS: list(aligned.bands.hands),
        "cloud_distance_before": aligned.before,
        "cloud_distance_after": aligned.after,
        "cloud_frames": aligned.frames,
        "not_fixed_by_the_clouds": list(aligned.unfixed),
        "notices": list(aligned.notices),
        "seconds": aligned.seconds,
    }


def lines(aligned: Aligned) -> list[str]:
    described = {p.name: p for p in aligned.twin.robot.parameters}
    out = [f"aligned on {aligned.frames} clouds in {aligned.seconds:.1f} s"]
    for name, fitted in aligned.fitted.items():
        p = described[name]
        value, spread = as_written(p, fitted.value), spread_as_written(p, fitted.std or 0.0)
        out.append(f"  {name:26s} {value:10.4g} +- {spread:.2g} {p.written or p.unit}   (described: {as_written(p, p.value):.4g})")
    before, after = 1e3 * aligned.before, 1e3 * aligned.after
    out.append(f"clouds without a hand lie {before:.3f} mm (root mean square) from the visible skin before, {after:.3f} mm after")
    if aligned.bands.hands:
        each = ", ".join(f"{name} {by:.2f}" for name, by in aligned.bands.by.items())
        out.append(f"bands under {' or '.join(map(repr, aligned.bands.hands))} are widened, as the clouds have it: {each}")
    if aligned.unfixed:
        out.append(f"not fixed by the clouds, left as described: {', '.join(aligned.unfixed)}")
    return [*out, *(f"note: {n}" for n in aligned.notices)]
