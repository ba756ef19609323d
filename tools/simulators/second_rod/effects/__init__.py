"""The laws of what may be wrong, by where they act.

effect.py        what every effect is, and the places where one may act
backbone.py      creep, precurvature, uneven stiffness, softening
tendon.py        friction, holes elsewhere, stretch
drive.py         lag, delay, saturation, backlash, an eccentric drum
load_cell.py     gain, bias, drift, crosstalk
surroundings.py  tilt, payload, wall, post, camera
odd.py           what no catalogue has
"""

from tools.simulators.second_rod.effects.backbone import Ageing, Asymmetry, Creep, Gradient, Precurvature, TemperatureSoftening
from tools.simulators.second_rod.effects.drive import Backlash, Delay, Drum, Lag, Saturation
from tools.simulators.second_rod.effects.effect import Effect
from tools.simulators.second_rod.effects.load_cell import Bias, Crosstalk, Drift, Gain
from tools.simulators.second_rod.effects.odd import Air, Loom, LooseDisk, Magnet, Stalks, Vibration
from tools.simulators.second_rod.effects.surroundings import Camera, Payload, Post, Tilt, Wall
from tools.simulators.second_rod.effects.tendon import Elasticity, Friction, Routing

CATALOGUE_KINDS: dict[str, type[Effect]] = {
    kind.name: kind
    for kind in (
        Friction, Creep, Precurvature, Asymmetry, Gradient, Tilt, Camera, Payload, Gain, Bias, Drift, Crosstalk, Routing, Delay,
        Lag, Saturation, TemperatureSoftening, Ageing, Backlash, Elasticity, Drum, Wall, Post,
    )
}  # fmt: skip
ODD_KINDS: dict[str, type[Effect]] = {kind.name: kind for kind in (Magnet, Air, LooseDisk, Loom, Stalks, Vibration)}
EFFECT_KINDS = {**CATALOGUE_KINDS, **ODD_KINDS}

__all__ = ["CATALOGUE_KINDS", "EFFECT_KINDS", "ODD_KINDS", "Effect"]
