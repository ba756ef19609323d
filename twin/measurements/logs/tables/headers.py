"""Units in the headers of columns: "x [mm]", "pos (deg)", "time_s", "Time (Seconds)"."""

import re

_IN_BRACKETS = re.compile(r"(.*?)\s*[\[(<]\s*([^\])>]{1,20})\s*[\])>]\s*")
_AFTER_UNDERSCORE = re.compile(r"(.*[A-Za-z0-9])[_.-]([A-Za-z]{1,8})")
# how headers write a unit -> how pint does
UNIT_WORDS = {
    "s": "s", "sec": "s", "secs": "s", "second": "s", "seconds": "s", "ms": "ms", "msec": "ms",
    "milliseconds": "ms", "millis": "ms", "us": "us", "µs": "us", "usec": "us", "microseconds": "us", "ns": "ns",
    "nsec": "ns", "nanoseconds": "ns",
    "m": "m", "meter": "m", "meters": "m", "metre": "m", "metres": "m", "mm": "mm", "millimeter": "mm", "millimeters": "mm",
    "cm": "cm", "centimeters": "cm", "in": "inch", "inch": "inch", "inches": "inch", "µm": "um", "um": "um",
    "rad": "rad", "radian": "rad", "radians": "rad", "deg": "deg", "degree": "deg", "degrees": "deg", "°": "deg", "º": "deg",
    "rad/s": "rad/s", "deg/s": "deg/s", "°/s": "deg/s", "rpm": "rpm", "m/s": "m/s", "mm/s": "mm/s", "m/s^2": "m/s^2",
    "m/s²": "m/s^2", "m/s2": "m/s^2", "n": "N", "newton": "N", "newtons": "N", "mn": "mN", "kn": "kN", "nm": "N*m", "n*m": "N*m",
    "n.m": "N*m",
    "n·m": "N*m", "n-m": "N*m", "mnm": "mN*m", "nmm": "N*mm", "a": "A", "amp": "A", "amps": "A", "ma": "mA", "v": "V", "volt": "V",
    "volts": "V", "mv": "mV", "ohm": "ohm", "ohms": "ohm", "ω": "ohm", "kohm": "kohm", "degc": "degC", "°c": "degC",
    "celsius": "degC", "c": "degC", "k": "K", "kelvin": "K", "kg": "kg", "g": "g", "gf": "gf", "hz": "Hz", "%": "percent",
    "-": "1",
}  # fmt: skip
# after an underscore only these: x_c, motor_a, finger_n are names
_AS_SUFFIX = (
    "s", "sec", "secs", "seconds", "ms", "msec", "us", "usec", "ns", "nsec", "m", "mm", "cm", "rad", "deg", "rpm", "N", "mN", "Nm",
    "mNm", "mA", "mV", "degC", "ohm", "radians", "degrees", "meters", "newtons",
)  # fmt: skip


def split_unit(header: str) -> tuple[str, str]:
    """Return a header without its unit, and the unit as pint writes it; empty where the header states none."""
    if match := _IN_BRACKETS.fullmatch(header):
        if unit := unit_word(match[2]):
            return match[1], unit
    elif (match := _AFTER_UNDERSCORE.fullmatch(header)) and match[2] in _AS_SUFFIX:
        return match[1], UNIT_WORDS[match[2].lower()]
    return header, ""


def unit_word(text: str) -> str:
    """Return a unit as pint writes it, or an empty text for what is none."""
    return UNIT_WORDS.get(text.strip().lower(), "")
