"""Write a report: all three files under temporary names first, then renamed."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from twin.diagnosis import Diagnosis
from twin.foundation.atomic_write import write_all_atomically
from twin.foundation.errors import DataError
from twin.prediction.storage import twin_table, twin_text
from twin.report.contents import contents
from twin.report.page import page


def write(diagnosis: Diagnosis, folder: Path | str, provenance: Mapping[str, Any]) -> None:
    """Write `folder`/report.json, report.html and twin.toml, over an earlier report; make a missing folder.

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
    texts["twin.toml"] = twin_text(table, provenance)
    way_out = "give a folder you may write to"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DataError(f"{folder}: cannot be made ({error.strerror or error}); {way_out}") from None
    # Names of files in the texts may hold surrogates, which UTF-8 cannot encode.
    write_all_atomically({folder / name: text.encode("utf-8", "backslashreplace") for name, text in texts.items()}, way_out)
