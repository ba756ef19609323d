"""Bodies that are any MJCF, simulated by MuJoCo's steps with the laws of effects between them (README.md).

loading.py   an MJCF, or why not         numbers.py   its numbers by address
body.py      channels and changes        poses.py     starts and payloads
solver.py    trials                      stepping.py  the compiled loop
friction.py  joints and tendons that rub  stops.py    bumpers of joints
routes.py    winches, and hinges that tendons cross
xml/         an MJCF as text, with changed numbers    drawing.py  its geoms and tendons to draw
"""

from twin.mechanics.mjcf.body import ModelBody, control_span, control_unit, element_senses, model_size, payload_places, tip_site
from twin.mechanics.mjcf.drawing import ModelFigure
from twin.mechanics.mjcf.loading import KINDS, SCALAR_JOINTS, LoadedModel, load_model
from twin.mechanics.mjcf.numbers import ATTRIBUTES, Attribute, applies, si_unit, slides
from twin.mechanics.mjcf.poses import contacts_at_start
from twin.mechanics.mjcf.routes import geared, outward, winches_of
from twin.mechanics.mjcf.solver import LONGEST_STEP, ModelSolver, Motion, longest_step
from twin.mechanics.mjcf.xml.precise import WrittenModel, copied, exact_text, with_comments
from twin.mechanics.mjcf.xml.written import check_same, name_element, written_model

__all__ = [
    "ATTRIBUTES",
    "KINDS",
    "LONGEST_STEP",
    "SCALAR_JOINTS",
    "Attribute",
    "LoadedModel",
    "ModelBody",
    "ModelFigure",
    "ModelSolver",
    "Motion",
    "WrittenModel",
    "applies",
    "check_same",
    "contacts_at_start",
    "control_span",
    "control_unit",
    "copied",
    "element_senses",
    "exact_text",
    "geared",
    "load_model",
    "longest_step",
    "model_size",
    "name_element",
    "outward",
    "payload_places",
    "si_unit",
    "slides",
    "tip_site",
    "winches_of",
    "with_comments",
    "written_model",
]
