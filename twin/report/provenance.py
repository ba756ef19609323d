"""The origin of a diagnosis: that of any result, and the settings."""

from dataclasses import asdict
from typing import Any

from twin.diagnosis import Settings
from twin.measurements import Recording
from twin.prediction.provenance import run_provenance


def provenance(recording: Recording, settings: Settings, command: str) -> dict[str, Any]:
    """Return everything needed to repeat a diagnosis, in types of TOML and JSON."""
    given = {name: value for name, value in asdict(settings).items() if value is not None}
    return {**run_provenance(command, settings.seed, recording.data_hash()), "settings": given}
