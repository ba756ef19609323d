"""A digital twin for tendon-driven soft and continuum robots that learns from measured data what it is missing.

measurements -> twin -> residual -> diagnosis -> better twin -> report

errors        the one family of errors
quantities    a parameter: value, unit, bounds, prior, source          compiled     machine code for inner loops
measurements  measurement sets in and out: Recording
effects       what a description may lack: one physical law per file
robots        robot.toml -> a MuJoCo body and the names in it
equilibrium   the static solve                                         dynamics     MuJoCo steps
bench         what prediction needs of a recording
twin          Robot + parameters + effects: predict(recording) -> Recording
residual      measured - predicted in sensor sigmas, and the noise     evaluate     the error of a given twin
storage       twin.toml                                                rollout      recordings of a twin's own motion
calibrate     the robot's own uncertain parameters, and those of effects
diagnose      which effect, or none, explains what is left
report        report.json, report.html, twin.toml
env           gymnasium environments                                   viewer       the robot in a browser
cli           the command line
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from twin.foundation.errors import TwinError

if TYPE_CHECKING:
    from twin.measurements import Recording, read, write
    from twin.prediction.storage import read_twin
    from twin.prediction.twin import Twin

__all__ = ["Recording", "Twin", "TwinError", "read", "read_twin", "write"]

_HOMES = {"Recording": "measurements", "Twin": "twin", "read": "measurements", "read_twin": "storage", "write": "measurements"}


def __getattr__(name: str) -> Any:
    """Public names on first use, so that `twin --help` does not wait for MuJoCo."""
    if name not in _HOMES:
        raise AttributeError(f"module 'twin' has no attribute {name!r}")
    return getattr(import_module(f"twin.{_HOMES[name]}"), name)
