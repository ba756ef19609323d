"""Where a report comes from: versions, settings, data hash, command, date."""

from __future__ import annotations

import platform
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from twin.diagnose import Settings
from twin.measurements import Recording

PACKAGES = ("mujoco", "numpy", "scipy", "numba")


def provenance(recording: Recording, settings: Settings, command: str) -> dict[str, Any]:
    """Everything needed to repeat a diagnosis, as TOML and JSON can hold it."""
    asked = {name: value for name, value in asdict(settings).items() if value is not None}
    return {**stamp(command, settings.seed, recording.data_hash()), "settings": asked}


def stamp(command: str, seed: int, data_hash: str, packages: tuple[str, ...] = ()) -> dict[str, Any]:
    """What any result comes from, with the versions of `packages` besides; the date is UTC, ISO 8601."""
    versions = {p: _version(p) for p in (*PACKAGES, *packages)}
    return {
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": command,
        "seed": seed,
        "data_hash": data_hash,
        "versions": {"twin": _version("tendon-twin"), "python": platform.python_version(), **versions},
    }


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "checkout" if package == "tendon-twin" else "not installed"
