"""Numbers as people read them: as many digits as their error allows, in units of everyday size."""

from __future__ import annotations

import math
from collections.abc import Sequence

from twin.evaluate import UNIT
from twin.quantities import Fitted

MM = 1e3  # m -> mm
SHOWN = {**UNIT, "current": ("A", 1.0)}  # group of outputs, or what drives a tendon -> unit and factor from SI
NONE = "\N{EN DASH}"  # where there is no number
MINUS = "\N{MINUS SIGN}"
FRIENDLY = {  # SI unit -> (shown unit, factor)
    "m": ("mm", 1e3),
    "kg": ("g", 1e3),
    "rad": ("°", 180.0 / math.pi),
    "m/N": ("mm/N", 1e3),
    "N/s": ("N/h", 3600.0),
    "1/K": ("%/K", 1e2),
    "1/s": ("%/h", 3.6e5),
    "1": ("", 1.0),
}
MODULI = (("GPa", 1e9), ("MPa", 1e6), ("kPa", 1e3))  # metals, plastics, silicones


def finite(value: float | None, factor: float = 1.0) -> float | None:
    """A plain float for JSON, times `factor`; None where there is no number."""
    return None if value is None or not math.isfinite(value) else float(value) * factor


def digits(value: float, std: float | None) -> int:
    """Decimals at which a value is written: down to the second digit of its standard error, else four significant ones."""
    size = std if std is not None and math.isfinite(std) and std > 0 else abs(value) * 1e-2
    if not math.isfinite(size) or size == 0:
        return 3
    return min(9, max(0, 1 - math.floor(math.log10(size))))


def number(value: float | None, decimals: int = 2) -> str:
    """`value` with this many decimals; an en dash where there is none."""
    if value is None or not math.isfinite(value):
        return NONE
    text = f"{value:.{decimals}f}"
    return text.replace("-", MINUS) if float(text) else text.lstrip("-")


def everyday(unit: str, value: float) -> tuple[str, float]:
    """The unit (mm, g, kPa to GPa, degrees, ...) that suits a `value` of an SI unit, and the factor from there; others stay SI."""
    if unit == "Pa":
        shown, size = next((m for m in MODULI if abs(value) >= m[1]), MODULI[-1])
        return shown, 1.0 / size
    return FRIENDLY.get(unit, (unit, 1.0))


def friendly(fitted: Fitted) -> Fitted:
    """The same quantity in a unit of everyday size."""
    unit, factor = everyday(fitted.unit, fitted.value)
    return Fitted(fitted.value * factor, None if fitted.std is None else fitted.std * factor, unit)


def plus_minus(fitted: Fitted) -> str:
    """As in "0.1030 ± 0.0013 mm": value, standard error if there is one, and unit, in a unit of everyday size."""
    shown = friendly(fitted)
    decimals = digits(shown.value, shown.std)
    text = number(shown.value, decimals)
    if finite(shown.std) is not None:
        text += f" ± {number(shown.std, decimals)}"
    return text + _suffix(shown.unit)


def rough(fitted: Fitted) -> str:
    """The value alone, with two significant digits, in a unit of everyday size: "0.047 mm"."""
    shown = friendly(fitted)
    return number(shown.value, places([shown.value], 2)) + _suffix(shown.unit)


def _suffix(unit: str) -> str:
    return unit if unit == "°" else f" {unit}" if unit else ""


def column(values: Sequence[float | None], significant: int = 3) -> list[str]:
    """Numbers of one table column, all with the same decimals, so that they line up; the largest gets `significant` digits."""
    return [number(v, places(values, significant)) for v in values]


def places(values: Sequence[float | None], significant: int) -> int:
    """Decimals that give the largest of the values this many significant digits."""
    known = [abs(v) for v in values if v is not None and math.isfinite(v) and v != 0]
    return 2 if not known else min(6, max(0, significant - 1 - math.floor(math.log10(max(known)))))


def percent(share: float) -> str:
    """A share of one in whole percent, "97 %"; what rounds to none or all is "less than 1 %" or "more than 99 %"."""
    if share < 0.005:
        return "less than 1 %"
    return "more than 99 %" if share >= 0.995 else f"{100 * share:.0f} %"


def upper_first(text: str) -> str:
    """The text as a sentence begins."""
    return text[:1].upper() + text[1:]
