"""Write an alignment to disk: the twin, and a report as text and as JSON."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from twin.foundation.atomic_write import write_atomically
from twin.foundation.errors import DataError
from twin.prediction.twin_file.storage import twin_table, write_twin
from twin.robots.numbers import in_file_unit, std_in_file_unit
from twin.shape.alignment.align import Alignment
from twin.shape.alignment.band_widening import BandWidening

ALIGNMENT_TEXT, ALIGNMENT_JSON = "alignment.txt", "alignment.json"  # file names
# keys of the JSON report
WIDENING_KEY, CONTACTS_KEY, FREE_KEY = "bands_widened_by", "bands_widened_under", "bands_widened_in_free_motion_by"


def write_alignment(aligned: Alignment, folder: Path, provenance: Mapping[str, Any]) -> None:
    """Write twin.toml, alignment.json and alignment.txt to `folder`, created if missing; each whole or not at all."""
    folder.mkdir(parents=True, exist_ok=True)
    write_atomically(folder / ALIGNMENT_JSON, (json.dumps(alignment_table(aligned), indent=1) + "\n").encode())
    write_atomically(folder / ALIGNMENT_TEXT, ("\n".join(alignment_lines(aligned)) + "\n").encode())
    write_twin(folder / "twin.toml", twin_table(aligned.twin, folder, aligned.fitted, {}), provenance)


def read_band_widening(source: str) -> BandWidening:
    """Read the band factors of an aligned twin, given by its folder or twin.toml; other twins have none.

    Raises DataError for a report that cannot be read.
    """
    folder = Path(source)
    path = (folder if folder.is_dir() else folder.parent) / ALIGNMENT_JSON
    if (Path(source).suffix != ".toml" and not folder.is_dir()) or not path.is_file():
        return BandWidening()
    try:
        found = json.loads(path.read_text("utf-8"))
        by, free = ({str(n): float(v) for n, v in found.get(key, {}).items()} for key in (WIDENING_KEY, FREE_KEY))
        return BandWidening(by, tuple(map(str, found.get(CONTACTS_KEY, []))), free)
    except (OSError, ValueError, AttributeError, TypeError) as fault:
        raise DataError(f"{path}: no report of an alignment ({type(fault).__name__}); run twin align again, or delete it") from None


def alignment_table(aligned: Alignment) -> dict[str, Any]:
    """Return the alignment as a table for JSON, in SI units."""
    return {
        "parameters": {n: {"value": f.value, "std": f.std, "unit": f.unit} for n, f in aligned.fitted.items()},
        WIDENING_KEY: dict(aligned.widening.factors),
        CONTACTS_KEY: list(aligned.widening.known_contacts),
        FREE_KEY: dict(aligned.widening.free_factors),
        "cloud_distance_before": aligned.distance_before,
        "cloud_distance_after": aligned.distance_after,
        "cloud_frames": aligned.cloud_count,
        "not_fixed_by_the_clouds": list(aligned.undetermined),
        "notices": list(aligned.notices),
        "seconds": aligned.seconds,
    }


def alignment_lines(aligned: Alignment) -> list[str]:
    """Return the alignment as lines of text."""
    described = {p.name: p for p in aligned.twin.robot.parameters}
    out = [f"aligned on {aligned.cloud_count} clouds in {aligned.seconds:.1f} s"]
    for name, fitted in aligned.fitted.items():
        p = described[name]
        value, spread = in_file_unit(p, fitted.value), std_in_file_unit(p, fitted.std or 0.0)
        out.append(
            f"  {name:26s} {value:10.4g} +- {spread:.2g} {p.file_unit or p.unit}   (described: {in_file_unit(p, p.value):.4g})"
        )
    before, after = 1e3 * aligned.distance_before, 1e3 * aligned.distance_after
    out.append(f"clouds without a hand lie {before:.3f} mm (root mean square) from the visible skin before, {after:.3f} mm after")
    contacts = " or ".join(map(repr, aligned.widening.known_contacts))
    for where, factors in (("in free motion", aligned.widening.free_factors), (f"under {contacts}", aligned.widening.factors)):
        if factors:
            each = ", ".join(f"{name} {by:.2f}" for name, by in factors.items())
            out.append(f"bands {where} are as many times as wide as for any finger: {each}")
    if aligned.undetermined:
        out.append(f"not fixed by the clouds, left as described: {', '.join(aligned.undetermined)}")
    return [*out, *(f"note: {n}" for n in aligned.notices)]
