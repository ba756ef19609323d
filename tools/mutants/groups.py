"""Which modules are changed, and the tests that must see it: few enough to end in a minute on an unchanged tree."""

from __future__ import annotations

from dataclasses import dataclass
from fnmatch import fnmatch


@dataclass(frozen=True)
class Group:
    """Modules (patterns of paths) and what pytest is given for them, the quickest first."""

    modules: tuple[str, ...]
    tests: tuple[str, ...]

    def has(self, file: str) -> bool:
        return any(fnmatch(file, pattern) for pattern in self.modules)


LAWS = "test_laws or transmission_error or says_what_it_is or off_places or misreads or hooks or parameters_have or begin_on_both"
CONTROL = "not tracked and not less_of and not foreseen and not knows_of and not examples and not thousand and not takes_up"
PLACES = "place_in_words or a_tip_alone or three_markers or bend or have_no_say"
BY_NUMBERS = f"row or number or proposed or asked or lacks or {PLACES}"
SUSPICIONS = "parts or sample or mistake or good_finger or unusual or not_pulled"
WORDS = "told or said or nearest or wave or a_step_is or drift_between"
TENSIONS = "made_of or nothing or made_its or grows or likeliest"
IDENTIFIABILITY = "told_apart or imitates or material or are_one or leaves_nothing or moves_nothing or several or blinds or units"


def _stage(name: str, *tests: str) -> Group:
    return Group((f"twin/diagnosis/{name}.py",), tests or (f"tests/test_{name}.py",))


GROUPS = {
    "saturation": Group(
        ("twin/effects/actuator_saturation.py",),
        ("tests/effects/test_laws.py", "tests/effects/test_effects.py", "-k", "drive or saturation"),
    ),
    "effects": Group(
        ("twin/effects/[!_]*.py",),
        (
            "tests/effects/test_laws.py",
            "tests/effects/test_conformance.py",
            "tests/effects/test_effects.py",
            "tests/diagnosis/test_transmission_error.py",
            "tests/mechanics/springs/test_sma.py",
            "-k",
            LAWS,
        ),
    ),
    "kept": Group(("twin/foundation/compiled.py",), ("tests/foundation/test_compiled.py",)),
    "calibrate": Group(
        ("twin/diagnosis/calibration/fit.py",),
        (
            "tests/diagnosis/calibration/test_calibrate.py",
            "-k",
            "intervals or linear or widen or neighbour_serve or thousandth or hardly or elsewhere or far_off",
        ),
    ),
    "residual": Group(
        ("twin/diagnosis/noise/model.py", "twin/diagnosis/noise/estimate.py", "twin/diagnosis/noise/whitening.py"),
        ("tests/diagnosis/noise/test_noise.py", "tests/diagnosis/test_diagnose.py", "tests/diagnosis/noise/test_cut_off.py"),
    ),
    "autocorrelation": Group(("twin/diagnosis/noise/autocorrelation.py",), ("tests/diagnosis/noise/test_autocorrelation.py",)),
    "laws": Group(
        ("twin/effects/base/chain.py",),
        ("tests/effects/test_laws.py", "tests/mechanics/rod/test_dynamics.py", "-k", "laws or alike"),
    ),
    "bench": Group(
        ("twin/prediction/prepared.py",),
        ("tests/prediction/test_prepared.py", "tests/prediction/test_evaluate.py", "tests/diagnosis/checks/test_design.py"),
    ),
    "twin": Group(
        ("twin/prediction/twin.py", "twin/prediction/simulate.py"),
        (
            "tests/prediction/test_evaluate.py",
            "tests/effects/test_laws.py",
            "tests/mechanics/rod/test_dynamics.py",
            "tests/mechanics/rod/test_transmission.py",
        ),
    ),
    "evaluate": Group(("twin/prediction/evaluate.py",), ("tests/prediction/test_evaluate.py",)),
    "choose": _stage("choose"),
    "lateness": _stage("lateness"),
    "path": _stage("path"),
    "gate": _stage("gate"),
    "judge": _stage("judge"),
    "search": _stage("search"),
    "null": _stage("null"),
    "split": _stage("split"),
    "spikes": _stage("spikes", "tests/diagnosis/checks/test_spikes.py", "-k", "not bench and not delay"),
    "left_out": _stage("left_out"),
    "design": _stage("design"),
    "evidence": _stage("evidence"),
    "information": Group(
        ("twin/diagnosis/calibration/fisher_information.py",), ("tests/diagnosis/calibration/test_fisher_information.py",)
    ),
    "loops": _stage("loops", "tests/diagnosis/checks/test_loops.py", "-k", "not day"),
    "identifiability": _stage("identifiability", "tests/diagnosis/checks/test_identifiability.py", "-k", IDENTIFIABILITY),
    "ranking": _stage("ranking"),
    "screen": _stage("screen"),
    "patterns": _stage("patterns"),
    "places": _stage("places", "tests/diagnosis/explain/test_describe.py", "-k", PLACES),
    "beyond": _stage("beyond"),
    "repeatability": _stage("repeatability"),
    "within": _stage("within", "tests/diagnosis/explain/test_within_trial.py", "-k", "not named_under"),
    "quick": _stage("quick"),
    "systematic": _stage("systematic", "tests/diagnosis/verdict/test_systematic.py", "-k", "not claimed"),
    "experiment": _stage("experiment"),
    "weigh": _stage("weigh", "tests/diagnosis/evidence/test_scored_model.py", "tests/diagnosis/search/test_choose.py"),
    "describe": _stage("describe", "tests/diagnosis/explain/test_describe_stage.py"),
    "words": _stage("words", "tests/diagnosis/test_stages.py", "tests/diagnosis/explain/test_describe.py", "-k", WORDS),
    "objective": _stage("objective", "tests/diagnosis/test_stages.py"),
    "pipeline": _stage("pipeline", "tests/diagnosis/test_stages.py", "tests/diagnosis/test_pipeline.py"),
    "thresholds": _stage(
        "thresholds", *(f"tests/test_{name}.py" for name in ("thresholds", "describe", "experiment", "design")), "-k", BY_NUMBERS
    ),
    "between": Group(
        tuple(f"twin/diagnosis/{name}.py" for name in ("look", "doubts", "conclusion", "study")),
        ("tests/diagnosis/test_stages.py",),
    ),
    "jumps": Group(
        ("twin/diagnosis/checks/jump_detection.py", "twin/diagnosis/checks/zero_jumps.py"),
        (
            "tests/diagnosis/checks/test_zero_jumps.py",
            "tests/diagnosis/checks/test_zeros.py",
            "-k",
            "test_jumps or moved_within or joints_zero",
        ),
    ),
    "base": _stage("calibrate", "tests/diagnosis/checks/test_zeros.py"),
    "suspicions": Group(
        ("twin/diagnosis/checks/suspicions/*.py",),
        (
            "tests/diagnosis/checks/test_suspicions_parts.py",
            "tests/diagnosis/checks/test_suspicions.py",
            "tests/diagnosis/checks/test_suspicions_silent.py",
            "-k",
            SUSPICIONS,
        ),
    ),
    "budget": _stage("budget", "tests/diagnosis/search/test_search.py", "-k", "time_is_up"),
    "seal": _stage("seal"),
    "stilled": _stage("stilled"),
    "passed": _stage("passed"),
    "rigs": _stage("rigs", "tests/diagnosis/checks/test_mixed_robots.py", "-k", "second_robot or fifth or all_possible"),
    "patches": Group(("twin/measurements/patches.py",), ("tests/measurements/test_patches.py", "-k", "not alone")),
    "tensions": Group(("twin/shape/estimators/tension_shape.py",), ("tests/shape/test_tension_shape.py", "-k", TENSIONS)),
    "align": Group(
        ("twin/shape/align*.py", "twin/shape/alignment/cloud_fit.py", "twin/shape/alignment/sensor_fit.py"),
        ("tests/shape/test_shape_band.py", "tests/shape/test_shape_strain.py", "-k", "alignment or aligned or clouds"),
    ),
    "training": Group(
        tuple(f"twin/shape/{name}.py" for name in ("training", "lesson", "weights", "judge", "folding")),
        ("tests/shape/test_shape_parts.py", "tests/shape/test_shape_training.py", "-k", "not killed"),
    ),
    "under_hand": Group(("twin/shape/pushed_trials.py",), ("tests/shape/test_under_hand.py",)),
    "shape": Group(
        ("twin/shape/*.py", "twin/mechanics/silicone/skin.py"),
        (
            "tests/shape/test_shape_parts.py",
            "tests/shape/test_shape_band.py",
            "tests/shape/test_shape_strain.py",
            "-k",
            "not align",
        ),
    ),
    "tip": Group(
        ("twin/control/tip_controller.py",),
        ("tests/control/test_control.py", "-k", "steady or surface or tracked or knows_of or tip_of_an_arc or off_by_is_taken"),
    ),
    "control": Group(
        ("twin/control/*.py",), ("tests/control/test_control.py", "tests/control/test_shape_control.py", "-k", CONTROL)
    ),
    "tasks": Group(("twin/tasks/*.py",), ("tests/tasks/test_tasks.py", "-k", "judged or nothing or lists")),
    "kinematics": Group(("twin/prediction/kinematics/*.py",), ("tests/prediction/test_kinematics.py",)),
    "antagonists": Group(
        ("twin/mechanics/rod/antagonists.py",), ("tests/mechanics/rod/test_transmission.py", "-k", "not diagnosis")
    ),
    "compiled": Group(
        tuple(f"twin/mechanics/rod/balance/{name}.py" for name in ("linear", "elastic", "hyperelastic")),
        ("tests/mechanics/rod/test_compiled_parts.py", "tests/mechanics/rod/test_balance.py"),
    ),
    "chain": Group(
        ("twin/mechanics/rod/equilibrium.py", "twin/mechanics/rod/balance/compile_chain.py"),
        ("tests/mechanics/rod/test_balance.py", "tests/mechanics/rod/test_equilibrium.py", "tests/mechanics/rod/test_lengths.py"),
    ),
    "equilibrium": Group(
        ("twin/mechanics/rod/*.py",),
        ("tests/mechanics/rod/test_balance.py", "tests/mechanics/rod/test_equilibrium.py", "tests/mechanics/rod/test_lengths.py"),
    ),
    "robots": Group(("twin/robots/families/continuum.py",), ("tests/robots/test_robots.py",)),
    "numbers": Group(("twin/report/numbers.py",), ("tests/report/test_report_words.py",)),
    "widths": Group(("twin/report/plots/loop_widths.py",), ("tests/report/test_report_words.py", "-k", "widths")),
}


def group_of(file: str) -> str | None:
    """The group that a module belongs to."""
    return next((name for name, group in GROUPS.items() if group.has(file)), None)
