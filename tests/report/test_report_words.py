"""The verdict's sentence, its numbers, and the console."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rich.console import Console
from small_diagnosis import diagnosis, recording

from twin.diagnosis import Claim, Fold
from twin.diagnosis.checks.loops import Loop, Loops
from twin.diagnosis.diagnosis import Missed
from twin.foundation.display_names import display_name
from twin.foundation.parameters import FittedValue
from twin.report import render_diagnosis, sentence
from twin.report.numbers import format_column, format_number, format_percent, format_with_error, two_significant_digits
from twin.report.plots import loop_widths as widths
from twin.report.plots.loops import advise_repeat, describe_loops
from twin.report.sections.answer import before_after
from twin.report.sentence import describe_claim, describe_undetectable, describe_verdict


def test_explained_says_what_how_much_and_where_it_was_measured():
    words = sentence(diagnosis())
    assert words.startswith(
        "Missing effect: tendon friction, mu = 0.1030 ± 0.0013. It explains 95 % of the structured error. These "
    )
    assert "data cannot distinguish it from tendon routing with time delay. On 2 held-out trials the error " in words
    assert words.endswith("falls from 0.78 to 0.49 mm (noise floor 0.44 mm).")


def test_a_twin_that_does_worse_on_held_out_trials_says_so():
    d = diagnosis()
    worse = replace(d.errors, after={"marker": 8.6e-4}, ci_after={"marker": (8e-4, 9e-4)})
    words = sentence(replace(d, errors=worse))
    assert "the error changes from 0.78 to 0.86 mm" in words
    assert words.endswith("worse than the calibrated one in position, by 10 %.")
    assert "worse" not in sentence(d)


def test_fitted_trials_without_a_structured_error_are_not_given_one():
    """A held-out trial that is missed bars "noise", though the fitted trials leave nothing else."""
    d = diagnosis("unexplained")
    missed = replace(d.errors, missed=(Missed(4, "marker", 1.2e-3, 0.44e-3),))
    clean = replace(d, structure_before=0.5 * d.limits.left, errors=missed)
    assert "Unexplained: after calibration only noise is left of the fitted trials." in sentence(clean)
    for other in (replace(clean, structure_before=2.0 * d.limits.left), replace(clean, errors=d.errors)):
        assert "a structured error of" in sentence(other)


def test_a_held_out_trial_without_equilibrium_is_named():
    d = diagnosis()
    words = sentence(replace(d, errors=replace(d.errors, lost=(4,))))
    assert "On 1 held-out trial the error" in words
    assert words.endswith("The twin has no equilibrium for held-out circle_4, so the errors leave it out.")


def test_few_trials_say_how_stable_the_claims_were_and_what_that_took():
    folds = (Fold(0, "explained", ("tendon_friction",)), Fold(1, "noise", ()), Fold(2, "explained", ("tendon_friction",)))
    words = sentence(diagnosis(folds=folds))
    assert words.endswith("the diagnosis was run 4 times; 2 of the 3 runs with one trial held out find the same effects.")


def test_what_cannot_be_told_apart_is_said_where_nothing_is_claimed():
    words = sentence(diagnosis("unexplained", ambiguous=(("tendon_friction",), ("backbone_creep",))))
    assert "It could be tendon friction or backbone creep; these data cannot tell which, so neither is claimed." in words


def test_a_name_that_is_as_good_as_another_does_not_stand_alone():
    d = diagnosis(ambiguous=(("tendon_friction",), ("backbone_creep",)))
    unsure = replace(d, claims=(replace(d.claims[0], probability=0.5),))
    assert sentence(unsure).startswith(
        "Missing effect: tendon friction or backbone creep, these data cannot tell which. The twin uses tendon friction, "
        "mu = 0.1030 ± 0.0013. It explains 95 % of the structured error. On 2 held-out trials"
    )
    assert sentence(d).startswith("Missing effect: tendon friction, mu = ")  # 0.99


def test_other_explanations_that_contain_the_claim_are_no_rivals():
    assert "cannot distinguish" not in sentence(diagnosis(ambiguous=(("tendon_friction", "time_delay"),)))


@pytest.mark.parametrize(
    ("verdict", "start", "end"),
    [
        ("noise", "No missing effect: after calibration only noise is left", "(noise floor 0.44 mm)."),
        (
            "partly_explained",
            "Partly explained: tendon friction",
            "direction of pull. On 2 held-out trials the error falls from 0.78 to 0.49 mm (noise floor 0.44 mm).",
        ),
        (
            "unexplained",
            "Unexplained: after calibration a structured error of 0.42 sigma is left that no known effect explains",
            ".",
        ),
    ],
)
def test_the_other_verdicts(verdict, start, end):
    words = sentence(diagnosis(verdict))
    assert words.startswith(start)
    assert words.endswith(end)


def test_a_name_in_doubt_that_leaves_little_is_not_said_to_leave_much():
    d = diagnosis("partly_explained", structure_after=0.05)
    assert describe_verdict(d).endswith(
        "Little error is left, but the result is in doubt: see the remaining error and the notices."
    )


def test_a_spectral_line_alone_is_named():
    words = sentence(diagnosis("unexplained", structure={"static": 0.01}, line=(50.0, 3.2)))
    assert "varies mostly with a line at 3.20 Hz" in words


def test_two_effects_share_a_sentence():
    d = diagnosis()
    other = replace(d.claims[0], effect="base_tilt", parameters={"about_y": FittedValue(0.05, 0.001, "rad")})
    words = sentence(replace(d, claims=(*d.claims, other)))
    assert words.startswith(
        "Missing effects: tendon friction, mu = 0.1030 ± 0.0013 and base tilt, about y = 2.865 ± 0.057°. Together they"
    )


def test_a_loop_is_told_in_millimetres_with_its_sign_and_noise():
    words = describe_loops(diagnosis().loops)
    assert "release and pull differ by 2.00 mm (disk_8, 2 trials, noise 0.01 mm); the robot lags" in words
    assert "look alike" not in words
    assert advise_repeat(diagnosis()) is None


def test_a_loop_that_time_could_make_asks_for_another_order():
    once = Loops("marker", "disk_8", (Loop(0, -2e-3, 2e-5, 40, None), Loop(1, -1e-3, 2e-5, 40, None)))
    d = diagnosis("noise", loops=once)
    assert "differ by \N{MINUS SIGN}1.50 mm" in describe_loops(d.loops)
    assert "the robot leads" in describe_loops(d.loops)
    assert "friction, creep and drift look alike here" in describe_loops(d.loops)
    assert (advise_repeat(d) or "").startswith("run circle_0 again with its pull interrupted")


def test_a_loop_of_noise_is_none():
    still = Loops("marker", "disk_8", (Loop(0, 3e-5, 2e-5, 40, None),))
    assert "differ by no more than noise (0.03 mm" in describe_loops(still)
    assert advise_repeat(diagnosis(loops=still)) is None
    assert "cannot be compared" in describe_loops(Loops("marker", "disk_8", ()))


def test_numbers_follow_their_error():
    assert format_with_error(FittedValue(0.10312, 0.0011, "1")) == "0.1031 ± 0.0011"
    assert format_with_error(FittedValue(6.4e-4, None, "m")) == "0.6400 mm"
    assert format_with_error(FittedValue(7.333e10, 2e8, "Pa")) == "73.33 ± 0.20 GPa"
    assert format_with_error(FittedValue(1.2345e5, 300.0, "Pa")) == "123.45 ± 0.30 kPa"
    assert format_with_error(FittedValue(-4.097e-5, 3.9e-7, "1/s")) == "\N{MINUS SIGN}14.75 ± 0.14 %/h"
    assert format_number(float("nan")) == "\N{EN DASH}"
    assert format_number(-0.001) == "0.00"
    assert format_column([0.0123, 1.5, None]) == ["0.01", "1.50", "\N{EN DASH}"]
    assert two_significant_digits(FittedValue(2.034e-5, None, "m/N")) == "0.020 mm/N"
    assert two_significant_digits(FittedValue(2e-5, 1e-6, "N/s")) == "0.072 N/h"
    assert two_significant_digits(FittedValue(0.0253, None, "rad")) == "1.4°"
    assert two_significant_digits(FittedValue(312.0, None, "N/m")) == "312 N/m"
    assert [format_percent(p) for p in (0.0, 0.5, 1.0)] == ["less than 1 %", "50 %", "more than 99 %"]


@pytest.mark.parametrize("verdict", ["noise", "explained", "partly_explained", "unexplained"])
def test_console_prints_the_sentence_and_reads_no_markup_in_data(verdict):
    d = diagnosis(verdict, of=replace(recording(), source="hardware: [red]desk[/red]"))
    out = Console(width=400, record=True, quiet=False, file=open("/dev/null", "w"))  # noqa: SIM115
    out.print(render_diagnosis(d))
    text = out.export_text()
    assert sentence(d) in text
    assert "[red]desk[/red]" in text
    assert ("Next experiment" in text) == (verdict != "noise")
    assert "These data cannot show: tendon elasticity (needs tendon displacements)." in text


def test_effects_hidden_for_one_reason_share_it_and_a_full_design_is_silent():
    of = diagnosis().identifiability
    backlash = replace(of[2], effect="tendon_backlash")
    toe = replace(of[2], form="toe")  # the same effect, said once
    warm = replace(of[2], effect="temperature_softening", lacking=("a log of the room",))
    words = (
        "These data cannot show: tendon elasticity, tendon backlash (needs tendon displacements); temperature softening (needs a"
    )
    assert describe_undetectable(diagnosis(identifiability=(*of, toe, backlash, warm))) == f"{words} log of the room)."
    assert describe_undetectable(diagnosis(identifiability=of[:2])) is None
    assert describe_undetectable(diagnosis(identifiability=(of[2], replace(toe, seen=0.1)))) is None, "one of its laws would show"


def test_of_many_numbers_of_a_kind_the_surest_are_said() -> None:
    """A gain of 1 is none: cords 2 and 5 read wrongly, the others as they should, however exactly that is known."""
    gains = {1: (1.0, 1e-4), 2: (0.5, 0.01), 3: (1.02, 0.02), 4: (0.99, 0.02), 5: (1.3, 0.02)}
    claim = Claim("sensor_gain", {f"gain_{i}": FittedValue(v, s, "1") for i, (v, s) in gains.items()}, 0.0, 0.9)
    words = describe_claim(claim)
    assert "gain 2 = 0.50" in words
    assert "gain 5 = 1.30" in words
    assert "gain 1 =" not in words
    assert words.endswith(" and 2 more")


def test_what_the_budget_left_untried_stands_beside_the_verdict():
    d = replace(diagnosis("unexplained"), untried=("tendon_friction", "backbone_creep", "tendon_friction + base_tilt", "contact"))
    words = sentence(d)
    assert "that no effect tried explains" in words
    assert "these were tried: tendon friction, backbone creep, tendon friction + base tilt and 1 more." in words
    assert "budget" not in sentence(diagnosis("unexplained"))


def test_loop_widths_are_drawn_against_the_load_measured_and_predicted() -> None:
    d = diagnosis()
    assert widths.plot(d) is None, "one load"
    held = [replace(i, loads=replace(i.loads, torque=np.full(len(i.time), 0.1 * k))) for k, i in enumerate(d.prepared.inputs)]
    drawn = widths.plot(replace(d, prepared=replace(d.prepared, inputs=tuple(held))))
    assert drawn is not None
    data: Any = drawn.figure.data
    measured, calibrated, after = data
    np.testing.assert_allclose(measured.x, 0.1 * np.arange(5), atol=1e-6)
    # mm: the loop made is 2 mm a newton wide, its mean over pulls to 2, 2.2, ... N half of that; its ends, at rest, do not count
    np.testing.assert_allclose(calibrated.y, 2.0 * (1.0 + 0.1 * np.arange(5)), rtol=0.15)
    assert max(*measured.y, *after.y) < 0.15, "noise alone"
    assert "(N m)" in drawn.figure.layout.xaxis.title.text
    assert "(mm)" in drawn.figure.layout.yaxis.title.text


@pytest.mark.parametrize(("apart", "two"), [(0.07, False), (0.15, True), (1.0, True)])
@pytest.mark.parametrize("size", [1e-3, 1.0, 100.0])
def test_loop_widths_are_drawn_of_loads_that_differ_whatever_their_size(size: float, apart: float, two: bool) -> None:
    """A load set twice comes back within some per cent; two loads are a tenth of the larger apart or more: mN m or 100 N m."""
    d = diagnosis()
    torques = size * np.linspace(1.0 - apart, 1.0, len(d.prepared.inputs))
    held = [
        replace(i, loads=replace(i.loads, torque=np.full(len(i.time), x))) for i, x in zip(d.prepared.inputs, torques, strict=True)
    ]
    assert (widths.plot(replace(d, prepared=replace(d.prepared, inputs=tuple(held)))) is not None) == two


@pytest.mark.parametrize(
    ("identifier", "words"), [("tendon_friction", "tendon friction"), ("sma_cooling", "SMA cooling"), ("creep", "creep")]
)
def test_identifiers_are_said_as_people_say_them(identifier: str, words: str) -> None:
    assert display_name(identifier) == words


def test_small_numbers_keep_their_digits() -> None:
    d = diagnosis()
    e = d.errors
    small = replace(
        e,
        nominal={**e.nominal, "tension": 0.08},
        calibrated={**e.calibrated, "tension": 0.0303},
        after={**e.after, "tension": 0.0089},
        floor={**e.floor, "tension": 0.008},
    )
    assert "(noise floor 0.44 mm), of tendon tension from 0.030 to 0.0089 N." in sentence(replace(d, errors=small))


@pytest.mark.parametrize(("described", "cut"), [(3e-3, False), (0.11, True)])
def test_a_description_far_off_does_not_hide_the_other_bars(described: float, cut: bool) -> None:
    """0.88 mm, the upper end of the calibrated one's interval, is the most of the others: 3 mm are drawn, of 110 the bar is cut."""
    d = diagnosis()
    far = replace(d, errors=replace(d.errors, nominal=dict.fromkeys(d.errors.nominal, described)))
    drawn = before_after.plot(far, "marker").figure
    shown = drawn.layout.xaxis.range
    assert (shown is not None) == cut
    assert shown is None or 0.88 < shown[1] < 110.0
    assert any("110" in str(a.text) for a in drawn.layout.annotations) == cut
