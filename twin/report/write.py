"""Write a report: all three files under temporary names first, then renamed."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from twin.diagnosis import Diagnosis
from twin.foundation.atomic_write import write_all_atomically
from twin.foundation.errors import DataError
from twin.foundation.parameters import FittedValue
from twin.prediction.mjcf import MODEL_FILE, Origins, export_mjcf
from twin.prediction.twin_file.storage import twin_table, twin_text
from twin.report.contents import contents
from twin.report.page import page


def write(diagnosis: Diagnosis, folder: Path | str, provenance: Mapping[str, Any]) -> None:
    """Write `folder`/report.json, report.html and twin.toml, over an earlier report; make a missing folder.

    Beside them, of a robot of family "mjcf": the twin as a better MJCF, robot.xml and its files.

    Everything is rendered before anything is written. Raises DataError where the folder is a file or cannot be written; then the
    files there stay.
    """
    folder = Path(folder)
    blocking = next((p for p in (folder, *folder.parents) if p.exists() and not p.is_dir()), None)
    if blocking is not None:
        raise DataError(f"{blocking} is a file; a report needs a folder: give one, or a new name")
    texts = {
        "report.json": json.dumps(contents(diagnosis, provenance), indent=2, allow_nan=False) + "\n",
        "report.html": page(diagnosis, provenance),
    }
    effects = {c.effect: c.parameters for c in diagnosis.claims}
    for effect, p in diagnosis.prepared.robot.uncertain:
        effects.setdefault(effect, {})[p.name] = diagnosis.parameters[f"{effect}.{p.name}"]
    table = twin_table(diagnosis.twin, folder, diagnosis.parameters, effects)
    texts["twin.toml"] = twin_text(table, provenance, diagnosis.correlation)
    files = _model_files(diagnosis, effects)
    way_out = "give a folder you may write to"
    try:
        for name in (*texts, *files):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DataError(f"{folder}: cannot be made ({error.strerror or error}); {way_out}") from None
    # Names of files in the texts may hold surrogates, which UTF-8 cannot encode.
    files |= {name: text.encode("utf-8", "backslashreplace") for name, text in texts.items()}
    write_all_atomically({folder / name: content for name, content in files.items()}, way_out)


def _model_files(diagnosis: Diagnosis, effects: Mapping[str, Mapping[str, FittedValue]]) -> dict[str, bytes]:
    """Return the twin as an MJCF with its files, by name; none of a robot of another family."""
    if "controls" not in diagnosis.prepared.robot.build().features:
        return {}
    fitted = {**diagnosis.parameters, **{f"{e}.{n}": v for e, found in effects.items() for n, v in found.items()}}
    std = {name: v.std for name, v in fitted.items() if v.std is not None}
    made = export_mjcf(diagnosis.twin, Origins(std, {c.effect: f"probability {c.probability:.3g}" for c in diagnosis.claims}))
    return {MODEL_FILE: made.text.encode(), **made.files}
