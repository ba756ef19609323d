"""`twin evaluate`: compute the error of a twin on a measurement set."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from rich.table import Table
from tyro.conf import Positional, arg

from twin.cli.terminal import out, show_progress


@dataclass(frozen=True)
class Evaluate:
    """Compute the error of a twin on a measurement set; fits nothing."""

    twin: Positional[Annotated[str, arg(help="a twin.toml, a report's folder, a robot's name or the path to its folder")]]
    set: Positional[Annotated[Path, arg(help="folder of a measurement set")]]
    json: Annotated[bool, arg(help="print the errors as JSON")] = False

    def run(self) -> None:
        from twin.measurements import read
        from twin.prediction.evaluate import evaluate
        from twin.prediction.twin_file.storage import read_twin

        twin = read_twin(self.twin)
        recording = read(self.set, least_trials=1)
        with show_progress(f"evaluating on {recording.title}"):
            error = evaluate(twin, recording)
        if self.json:
            print(json.dumps(error, indent=2))
            return
        table = Table("kind", "RMS error", "unit")
        for kind, block in error["by_kind"].items():
            table.add_row(kind, f"{block['rmse']:.4g}", block["unit"])
        out.print(table)
