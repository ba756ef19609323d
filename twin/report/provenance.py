"""The origin of a result: versions, settings, data hash, command, date."""

from __future__ import annotations

import platform
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from twin.diagnosis import Settings
from twin.measurements import Recording

PACKAGES = ("mujoco", "numpy", "scipy", "numba")


def provenance(recording: Recording, settings: Settings, command: str) -> dict[str, Any]:
    """Return everything needed to repeat a diagnosis, in types of TOML and JSON."""
    given = {name: value for name, value in asdict(settings).items() if value is not None}
    return {**run_provenance(command, settings.seed, recording.data_hash()), "settings": given}


def run_provenance(command: str, seed: int, data_hash: str, packages: tuple[str, ...] = ()) -> dict[str, Any]:
    """Return the origin of any result, with the versions of `packages` as well; the date is UTC, ISO 8601."""
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
