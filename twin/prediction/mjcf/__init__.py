"""A twin of an MJCF as a better MJCF, and the steps of what MuJoCo cannot say.

export.py    the MJCF and its comments     natives.py   effects as attributes of MuJoCo
stepper.py   the laws beside it            delivery.py  delay and lag of drives, step by step
comments.py  what is said of the numbers
"""

from twin.prediction.mjcf.comments import Origins, origins_of
from twin.prediction.mjcf.export import MODEL_FILE, export_mjcf, write_mjcf
from twin.prediction.mjcf.stepper import ModelStepper

__all__ = ["MODEL_FILE", "ModelStepper", "Origins", "export_mjcf", "origins_of", "write_mjcf"]
