"""Twins as MJCFs, and the steps of what MuJoCo cannot say.

export.py         the MJCF                      natives.py  joint friction as attributes of MuJoCo
comments.py       what is said of its numbers   stepper.py  the laws beside a twin of an MJCF
chain.py          a rod as an MJCF
chain_stepper.py  the laws beside it
"""

from twin.prediction.mjcf.chain_stepper import ChainStepper
from twin.prediction.mjcf.comments import Origins, origins_of
from twin.prediction.mjcf.export import MODEL_FILE, export_mjcf, write_mjcf
from twin.prediction.mjcf.stepper import ModelStepper, TwinStepper

__all__ = [
    "MODEL_FILE",
    "ChainStepper",
    "ModelStepper",
    "Origins",
    "TwinStepper",
    "export_mjcf",
    "origins_of",
    "write_mjcf",
]
