"""Bodies that are any MJCF, simulated by MuJoCo's steps with the laws of effects between them (README.md).

loading.py   an MJCF, or why not         numbers.py   its numbers by address
body.py      channels and changes        poses.py     starts and payloads
solver.py    trials                      stepping.py  the compiled loop
friction.py  joints and tendons that rub
"""

from twin.mechanics.mjcf.body import ModelBody, element_senses, payload_places, tip_site
from twin.mechanics.mjcf.loading import KINDS, SCALAR_JOINTS, LoadedModel, load_model
from twin.mechanics.mjcf.numbers import ATTRIBUTES, Attribute, applies, si_unit, slides
from twin.mechanics.mjcf.solver import LONGEST_STEP, ModelSolver, half_step

__all__ = [
    "ATTRIBUTES",
    "KINDS",
    "LONGEST_STEP",
    "SCALAR_JOINTS",
    "Attribute",
    "LoadedModel",
    "ModelBody",
    "ModelSolver",
    "applies",
    "element_senses",
    "half_step",
    "load_model",
    "payload_places",
    "si_unit",
    "slides",
    "tip_site",
]
