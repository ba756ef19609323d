"""Format numbers for people: as many digits as the error allows, in units of everyday size."""

import math
from collections.abc import Sequence

from twin.foundation.parameters import FittedValue
from twin.prediction.evaluate import OUTPUT_GROUPS

MM_PER_M = 1e3
PERCENT = 100.0
# Group of outputs, or a tendon's drive -> unit and factor from SI.
DISPLAY_UNITS = {**{name: (g.unit, g.factor) for name, g in OUTPUT_GROUPS.items()}, "current": ("A", 1.0), "control": ("SI", 1.0)}
NO_NUMBER = "\N{EN DASH}"
MINUS = "\N{MINUS SIGN}"
EVERYDAY_UNITS = {  # SI unit -> (shown unit, factor)
    "m": ("mm", 1e3),
    "kg": ("g", 1e3),
    "rad": ("°", 180.0 / math.pi),
    "m/N": ("mm/N", 1e3),
    "N/s": ("N/h", 3600.0),
    "1/K": ("%/K", 1e2),
    "1/s": ("%/h", 3.6e5),
    "1": ("", 1.0),
}
MODULUS_UNITS = (("GPa", 1e9), ("MPa", 1e6), ("kPa", 1e3))  # metals, plastics, silicones


def finite_or_none(value: float | None, factor: float = 1.0) -> float | None:
    """Return `value` times `factor` as a plain float for JSON; None where it is not finite."""
    return None if value is None or not math.isfinite(value) else float(value) * factor


def decimals_for_error(value: float, std: float | None) -> int:
    """Return the decimals to write: to the second digit of the standard error, or for four significant digits."""
    size = std if std is not None and math.isfinite(std) and std > 0 else abs(value) * 1e-2
    if not math.isfinite(size) or size == 0:
        return 3
    return min(9, max(0, 1 - math.floor(math.log10(size))))


def format_number(value: float | None, decimals: int = 2) -> str:
    """Format `value` with this many decimals; an en dash where it is not finite."""
    if value is None or not math.isfinite(value):
        return NO_NUMBER
    text = f"{value:.{decimals}f}"
    return text.replace("-", MINUS) if float(text) else text.lstrip("-")


def everyday_unit(unit: str, value: float) -> tuple[str, float]:
    """Return the everyday unit (mm, g, kPa to GPa, degrees, ...) for a `value` in SI, and its factor; other units stay SI."""
    if unit == "Pa":
        shown, size = next((m for m in MODULUS_UNITS if abs(value) >= m[1]), MODULUS_UNITS[-1])
        return shown, 1.0 / size
    return EVERYDAY_UNITS.get(unit, (unit, 1.0))


def in_everyday_unit(fitted: FittedValue) -> FittedValue:
    """Convert a fitted value to a unit of everyday size."""
    unit, factor = everyday_unit(fitted.unit, fitted.value)
    return FittedValue(fitted.value * factor, None if fitted.std is None else fitted.std * factor, unit)


def format_with_error(fitted: FittedValue) -> str:
    """Format value, standard error if there is one, and unit, as in "0.1030 ± 0.0013 mm"."""
    shown = in_everyday_unit(fitted)
    decimals = decimals_for_error(shown.value, shown.std)
    text = format_number(shown.value, decimals)
    if finite_or_none(shown.std) is not None:
        text += f" ± {format_number(shown.std, decimals)}"
    return text + _unit_suffix(shown.unit)


def two_significant_digits(fitted: FittedValue) -> str:
    """Format the value alone with two significant digits and unit, as in "0.047 mm"."""
    shown = in_everyday_unit(fitted)
    return format_number(shown.value, decimals_for_digits([shown.value], 2)) + _unit_suffix(shown.unit)


def _unit_suffix(unit: str) -> str:
    return unit if unit == "°" else f" {unit}" if unit else ""


def format_column(values: Sequence[float | None], significant: int = 3) -> list[str]:
    """Format the numbers of a table column with equal decimals, so that the largest has `significant` digits."""
    return [format_number(v, decimals_for_digits(values, significant)) for v in values]


def decimals_for_digits(values: Sequence[float | None], significant: int) -> int:
    """Return the decimals that give the largest of the values this many significant digits."""
    known = [abs(v) for v in values if v is not None and math.isfinite(v) and v != 0]
    return 2 if not known else min(6, max(0, significant - 1 - math.floor(math.log10(max(known)))))


def format_percent(share: float) -> str:
    """Format a share of one in whole percent; 0 and 100 % become "less than 1 %" and "more than 99 %"."""
    if share < 0.005:
        return "less than 1 %"
    return "more than 99 %" if share >= 0.995 else f"{100 * share:.0f} %"


def capitalised(text: str) -> str:
    """Return the text with its first letter capitalised."""
    return text[:1].upper() + text[1:]
