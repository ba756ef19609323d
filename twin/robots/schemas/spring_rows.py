"""Rows of the SMA springs that pull a robot's tendons; a file has all of them or none."""

from collections.abc import Mapping

from twin.body.drives.spring import SPRING_PREFIX, SPRING_UNITS
from twin.robots.schema import Row

# name -> usual unit, meaning, SI range
_DESCRIPTIONS = {
    "resistance": ("ohm", "electrical resistance of a spring", 1e-3, 1e3),
    "capacity": ("J/K", "heat capacity", 1e-6, 1e3),
    "coils": ("1", "number of coils", 0.5, 1e3),
    "loss": ("mW/K", "heat loss h of a closed spring at ambient", 1e-6, 10.0),
    "loss_warm": ("mW/K^2", "change of h per kelvin above ambient", -0.1, 0.1),
    "loss_warm_2": ("mW/K^3", "change of h per kelvin squared", -1e-3, 1e-3),
    "loss_open": ("mW/(K*mm)", "change of h per elongation of a coil", -100.0, 100.0),
    "loss_open_2": ("mW/(K*mm^2)", "change of h per elongation squared", -1e5, 1e5),
    "loss_warm_open": ("mW/(K^2*mm)", "change of h per kelvin and elongation", -10.0, 10.0),
    "martensite_start": ("degC", "martensite start temperature, unstressed", 100.0, 1000.0),
    "martensite_finish": ("degC", "martensite finish temperature, below its start", 100.0, 1000.0),
    "austenite_start": ("degC", "austenite start temperature, unstressed", 100.0, 1000.0),
    "austenite_finish": ("degC", "austenite finish temperature, above its start", 100.0, 1000.0),
    "force_per_kelvin": ("N/K", "rise of the transformation forces with temperature", 1e-4, 1e3),
    "austenite_stiffness": ("N/mm", "stiffness of the hot spring", 1e-1, 1e7),
    "martensite_stiffness": ("N/mm", "stiffness of the cold, detwinned spring", 1e-1, 1e7),
    "detwinning_start": ("N", "force at which the cold spring's plateau begins", 1e-4, 1e5),
    "detwinning_finish": ("N", "force at which it ends, above its start", 1e-4, 1e5),
    "transformation_elongation": ("mm", "elongation by transformation", 1e-5, 1.0),
    "initial_elongation": ("mm", "elongation on the straight robot", 0.0, 1.0),
    "initial_tension": ("N", "tension at the start of a trial", 0.0, 1e3),
}
SPRING_ROWS = tuple(
    Row(SPRING_PREFIX + name, SPRING_UNITS[name], usual, meaning, low, high, group="springs")
    for name, (usual, meaning, low, high) in _DESCRIPTIONS.items()
)  # fmt: skip
ORDERED_PAIRS = (
    ("martensite_finish", "martensite_start"), ("austenite_start", "austenite_finish"), ("detwinning_start", "detwinning_finish")
)  # fmt: skip


def spring_conflicts(values: Mapping[str, float]) -> list[str]:
    """Return the contradictions between the springs' numbers (SI, by name)."""
    pairs = [(SPRING_PREFIX + low, SPRING_PREFIX + high) for low, high in ORDERED_PAIRS]
    return [f"{low} is not below {high}" for low, high in pairs if low in values and not values[low] < values[high]]
