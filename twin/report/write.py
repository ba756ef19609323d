"""A report as files: all three written beside their places first, then renamed."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from twin.diagnose import Diagnosis
from twin.errors import DataError
from twin.report.contents import contents
from twin.report.page import page
from twin.storage import twin_table, write_twin


def write(diagnosis: Diagnosis, folder: Path | str, provenance: Mapping[str, Any]) -> None:
    """Writes `folder`/report.json, report.html and twin.toml, over an earlier report; makes the folder where it is missing.

    Everything is rendered before anything is written. Raises DataError where the folder is a file or cannot be written to;
    then what was there stays.
    """
    folder = Path(folder)
    in_the_way = next((p for p in (folder, *folder.parents) if p.exists() and not p.is_dir()), None)
    if in_the_way is not None:
        raise DataError(f"{in_the_way} is a file; a report needs a folder: give one, or a new name")
    texts = {
        "report.json": json.dumps(contents(diagnosis, provenance), indent=2, allow_nan=False) + "\n",
        "report.html": page(diagnosis, provenance),
    }
    effects = {c.effect: c.parameters for c in diagnosis.claims}
    for effect, p in diagnosis.bench.robot.uncertain:
        effects.setdefault(effect, {})[p.name] = diagnosis.parameters[f"{effect}.{p.name}"]
    table = twin_table(diagnosis.twin, folder, diagnosis.parameters, effects)
    parts = {name: folder / f".{name}.part" for name in (*texts, "twin.toml")}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in texts.items():
            parts[name].write_bytes(text.encode("utf-8", "backslashreplace"))  # file names may hold what is no text
        write_twin(parts["twin.toml"], table, provenance)
        for name, part in parts.items():
            part.replace(folder / name)
    except OSError as error:
        words = f"{folder}: the report cannot be written ({error.strerror or error}); give a folder you may write to"
        raise DataError(words) from None
    finally:
        for part in parts.values():
            part.unlink(missing_ok=True)
