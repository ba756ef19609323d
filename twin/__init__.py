"""A digital twin for tendon-driven robots that learns from measured data what it is missing.

    recording = twin.read(twin.sample("friday"))    # a measurement set
    found = twin.diagnose(recording)                # which effect the robot's description lacks
    found.save("report")                            # report.html, report.json, twin.toml
    better = twin.Twin.load("report")
    better.predict(recording)                       # a Recording again

README.md in this folder says which package does what.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from twin.foundation.errors import TwinError

if TYPE_CHECKING:
    from twin import effects
    from twin.diagnosis import Diagnosis, Settings, calibrate, diagnose
    from twin.measurements import Recording, read, write
    from twin.prediction.evaluate import evaluate
    from twin.prediction.rollout import commands, rollout
    from twin.prediction.twin import Twin
    from twin.robots import Robot, sample

_HOMES = {
    "Diagnosis": "diagnosis",
    "Recording": "measurements",
    "Robot": "robots",
    "Settings": "diagnosis",
    "Twin": "prediction.twin",
    "calibrate": "diagnosis",
    "commands": "prediction.rollout",
    "diagnose": "diagnosis",
    "evaluate": "prediction.evaluate",
    "read": "measurements",
    "rollout": "prediction.rollout",
    "sample": "robots",
    "write": "measurements",
}

__all__ = [
    "Diagnosis",
    "Recording",
    "Robot",
    "Settings",
    "Twin",
    "TwinError",
    "calibrate",
    "commands",
    "diagnose",
    "effects",
    "evaluate",
    "read",
    "rollout",
    "sample",
    "write",
]


def __getattr__(name: str) -> Any:
    """Import a public name on first use, so that `twin --help` does not wait for MuJoCo."""
    if name == "effects":
        return import_module("twin.effects")
    if name not in _HOMES:
        raise AttributeError(f"module 'twin' has no attribute {name!r}; it has {', '.join(__all__)}")
    return getattr(import_module(f"twin.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return __all__
