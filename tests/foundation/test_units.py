"""Units at the border: what is one, of which dimension, and how large; no text can hang or exhaust the program."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from twin.foundation.errors import DataError
from twin.foundation.units import difference_scale, unit_scale

# (unit, SI unit, factor, offset) from their definitions
TAKEN = [
    ("mm", "m", 1e-3, 0.0), ("inch", "m", 0.0254, 0.0), ("µm", "m", 1e-6, 0.0), ("GPa", "Pa", 1e9, 0.0), ("kPa", "Pa", 1e3, 0.0),
    ("deg", "rad", math.pi / 180, 0.0), ("turn", "rad", 2 * math.pi, 0.0), ("gf", "N", 9.80665e-3, 0.0), ("degC", "K", 1.0, 273.15),
    ("degF", "K", 5 / 9, 459.67 * 5 / 9), ("1", "1", 1.0, 0.0), ("percent", "1", 0.01, 0.0), ("mm/N", "m/N", 1e-3, 0.0),
    ("mW/(K^2*mm)", "W/(K^2*m)", 1.0, 0.0), ("gram_force/mm", "N/m", 9.80665, 0.0), ("m/s²", "m/s^2", 1.0, 0.0),
    ("g/cm^3", "kg/m^3", 1e3, 0.0),
]  # fmt: skip
REFUSED = [
    ("", "m"), (" ", "m"), ("1", "rad"), ("deg**2", "rad"), ("rad/s", "rad"), ("rad", "1"), ("deg", "1"), ("dB", "1"), ("N", "m"),
    ("9**9**9", "m"), ("m**9**9", "m"), ("((m**99)**99)**99", "m"), ("10 mm", "m"), ("2*m", "m"), ("g g/g", "kg"), ("m m/m", "m"),
    ("delta_degC", "K"), ("m" * 5000, "m"), ("mmm", "m"), ("None", "1"), ("m\0", "m"), ("[m]", "m"), ("m**999", "m"),
    ("__class__", "m"),
]  # fmt: skip


@pytest.mark.parametrize(("unit", "si", "factor", "offset"), TAKEN)
def test_a_unit_is_as_large_as_its_definition(unit: str, si: str, factor: float, offset: float) -> None:
    scale = unit_scale(unit, si)
    # Two roundings of a product and a quotient, 1e-16 each; the offset of degF is a difference of pint's own.
    assert scale.to_si(7.0) == pytest.approx(7.0 * factor + offset, rel=1e-14)
    assert scale.without_offset().to_si(7.0) == pytest.approx(7.0 * factor, rel=1e-12)


@pytest.mark.parametrize(("unit", "si"), REFUSED)
def test_what_is_no_such_unit_is_refused_in_one_line(unit: str, si: str) -> None:
    with pytest.raises(DataError) as caught:
        unit_scale(unit, si)
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 200


@pytest.mark.parametrize("unit", ["degC", "degF"])
def test_a_difference_has_no_zero_of_its_own(unit: str) -> None:
    assert unit_scale(unit, "K").offset != 0.0
    with pytest.raises(DataError, match="difference; write K"):
        difference_scale(unit, "K")


@given(st.text("mgNKPa1290*/^()²- _.", max_size=40) | st.text(max_size=40), st.sampled_from(["m", "kg", "rad", "1", "K", "N/m"]))
@settings(max_examples=400, deadline=None)
def test_any_text_is_a_unit_or_refused(text: str, si: str) -> None:
    try:
        scale = unit_scale(text, si)
    except DataError as refused:
        if not str(refused).isprintable():
            pytest.fail(f"not one line: {refused!r}")
    else:
        if not (math.isfinite(scale.to_si(1.0)) and scale.numerator > 0 and scale.denominator > 0):
            pytest.fail(f"{text!r} has no size")
