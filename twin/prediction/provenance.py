"""The origin of a result: versions, seed, data hash, command, date."""

import platform
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from typing import Any

PACKAGES = ("mujoco", "numpy", "scipy", "numba")


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
