"""Which modules are changed, and the tests that must see it: few enough to end in a minute on an unchanged tree."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path

REPOSITORY = Path(__file__).parents[2]
DIAGNOSIS_TESTS = REPOSITORY / "tests/diagnosis"


@dataclass(frozen=True)
class Group:
    """Modules (patterns of paths) and what pytest is given for them, the quickest first."""

    modules: tuple[str, ...]
    tests: tuple[str, ...]

    @staticmethod
    def of(modules: str, tests: str) -> Group:
        """A group of modules with spaces between them, below `twin`, and of arguments as in a shell, files below `tests`."""
        files = (f"tests/{word}" if word.endswith(".py") else word for word in shlex.split(tests))
        return Group(tuple(f"twin/{name}" for name in modules.split()), tuple(files))

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
FIT = "intervals or linear or widen or neighbour_serve or thousandth or hardly or elsewhere or far_off"
TIP = "steady or surface or tracked or knows_of or tip_of_an_arc or off_by_is_taken"
ROD = "mechanics/rod/statics/test_balance.py mechanics/rod/statics/test_equilibrium.py mechanics/rod/statics/test_lengths.py"
CHECK_TESTS, STAGE_TESTS = "diagnosis/checks", "diagnosis/test_stages.py"
SHAPE = "shape/test_shape_parts.py shape/test_shape_band.py shape/test_shape_strain.py"

# Modules of the diagnosis that are not named here have the test file that stands where they stand, and its name for a group.
GROUPS = {
    name: Group.of(modules, tests)
    for name, modules, tests in (
        ("saturation", "effects/actuator_saturation.py", "effects/test_laws.py effects/test_effects.py -k 'drive or saturation'"),
        ("laws", "effects/base/chain.py", "effects/test_laws.py mechanics/rod/test_dynamics.py -k 'laws or alike'"),
        ("effects", "effects/[!_]*.py", "effects/test_laws.py effects/test_conformance.py effects/test_effects.py "
         f"diagnosis/test_transmission_error.py mechanics/springs/test_sma.py -k '{LAWS}'"),
        ("kept", "foundation/compiled.py", "foundation/test_compiled.py"),
        ("calibrate", "diagnosis/calibration/fit.py diagnosis/calibration/model.py diagnosis/calibration/objective.py",
         f"diagnosis/calibration/test_calibrate.py -k '{FIT}'"),
        ("residual", "diagnosis/noise/model.py diagnosis/noise/estimate.py diagnosis/noise/whitening.py",
         "diagnosis/noise/test_noise.py diagnosis/test_diagnose.py diagnosis/noise/test_cut_off.py"),
        ("prepared", "prediction/prepared.py",
         f"prediction/test_prepared.py prediction/test_evaluate.py {CHECK_TESTS}/test_design.py"),
        ("twin", "prediction/twin.py prediction/simulate.py", "prediction/test_evaluate.py effects/test_laws.py "
         "mechanics/rod/test_dynamics.py mechanics/rod/test_transmission.py"),
        ("evaluate", "prediction/evaluate.py", "prediction/test_evaluate.py"),
        ("spikes", "diagnosis/checks/spikes.py", f"{CHECK_TESTS}/test_spikes.py -k 'not bench and not delay'"),
        ("loops", "diagnosis/checks/loops.py", f"{CHECK_TESTS}/test_loops.py -k 'not day'"),
        ("identifiability", "diagnosis/checks/identifiability.py", f"{CHECK_TESTS}/test_identifiability.py -k '{IDENTIFIABILITY}'"),
        ("patterns", "diagnosis/evidence/first_order.py", "diagnosis/evidence/test_first_order_patterns.py"),
        ("error_location", "diagnosis/explain/error_location.py", f"diagnosis/explain/test_describe.py -k '{PLACES}'"),
        ("within_trial", "diagnosis/explain/within_trial.py", "diagnosis/explain/test_within_trial.py -k 'not named_under'"),
        ("systematic", "diagnosis/verdict/systematic.py", "diagnosis/verdict/test_systematic.py -k 'not claimed'"),
        ("scored_model", "diagnosis/evidence/scored_model.py",
         "diagnosis/evidence/test_scored_model.py diagnosis/search/test_choose.py"),
        ("describe", "diagnosis/explain/describe.py", "diagnosis/explain/test_describe_stage.py"),
        ("words", "diagnosis/explain/words.py", f"{STAGE_TESTS} diagnosis/explain/test_describe.py -k '{WORDS}'"),
        ("pipeline", "diagnosis/pipeline.py", f"{STAGE_TESTS} diagnosis/test_pipeline.py"),
        ("thresholds", "diagnosis/thresholds.py", "diagnosis/test_thresholds.py diagnosis/explain/test_describe.py "
         f"diagnosis/explain/test_next_experiment.py {CHECK_TESTS}/test_design.py -k '{BY_NUMBERS}'"),
        ("between", "diagnosis/checks/preview.py diagnosis/checks/fit_warnings.py diagnosis/conclusion.py "
         "diagnosis/fit_context.py diagnosis/calibration/first_calibration.py", STAGE_TESTS),
        ("jumps", "diagnosis/checks/jump_detection.py diagnosis/checks/zero_jumps.py",
         f"{CHECK_TESTS}/test_zero_jumps.py {CHECK_TESTS}/test_zeros.py -k 'test_jumps or moved_within or joints_zero'"),
        ("base", "diagnosis/calibration/calibrate.py", f"{CHECK_TESTS}/test_zeros.py"),
        ("suspicions", "diagnosis/checks/suspicions/*.py", f"{CHECK_TESTS}/suspicions/test_suspicions_parts.py "
         f"{CHECK_TESTS}/suspicions/test_suspicions.py {CHECK_TESTS}/suspicions/test_suspicions_silent.py -k '{SUSPICIONS}'"),
        ("budget", "diagnosis/budget.py", "diagnosis/search/test_search.py -k time_is_up"),
        ("friction_noise", "diagnosis/noise/friction.py", "diagnosis/noise/test_friction_noise.py"),
        ("transmission", "diagnosis/noise/transmission.py", "diagnosis/noise/test_transmission_of_noise.py"),
        ("mixed_robots", "diagnosis/checks/mixed_robots.py",
         f"{CHECK_TESTS}/test_mixed_robots.py -k 'second_robot or fifth or all_possible'"),
        ("patches", "measurements/patches.py", "measurements/test_patches.py -k 'not alone'"),
        ("tensions", "shape/estimators/tension_shape.py", f"shape/test_tension_shape.py -k '{TENSIONS}'"),
        ("align", "shape/alignment/align.py shape/alignment/report.py shape/alignment/cloud_fit.py shape/alignment/sensor_fit.py",
         "shape/test_shape_band.py shape/test_shape_strain.py -k 'alignment or aligned or clouds'"),
        ("training", "shape/training/*.py shape/estimators/weights.py",
         "shape/test_shape_parts.py shape/test_shape_training.py -k 'not killed'"),
        ("under_hand", "shape/pushed_trials.py", "shape/test_under_hand.py"),
        ("shape", "shape/*.py mechanics/silicone/skin.py", f"{SHAPE} -k 'not align'"),
        ("tip", "control/tip_controller.py", f"control/test_control.py -k '{TIP}'"),
        ("control", "control/*.py", f"control/test_control.py control/test_shape_control.py -k '{CONTROL}'"),
        ("tasks", "tasks/*.py", "tasks/test_tasks.py -k 'judged or nothing or lists'"),
        ("kinematics", "prediction/kinematics/*.py", "prediction/test_kinematics.py"),
        ("antagonists", "mechanics/rod/antagonists.py", "mechanics/rod/test_transmission.py -k 'not diagnosis'"),
        ("compiled", "mechanics/rod/balance/linear.py mechanics/rod/balance/elastic.py mechanics/rod/balance/hyperelastic.py",
         "mechanics/rod/test_compiled_parts.py mechanics/rod/statics/test_balance.py"),
        ("equilibrium", "mechanics/rod/*.py", ROD),
        ("robots", "robots/families/continuum.py", "robots/test_robots.py"),
        ("numbers", "report/numbers.py", "report/test_report_words.py"),
        ("widths", "report/plots/loop_widths.py", "report/test_report_words.py -k widths"),
    )
}  # fmt: skip


def group_of(file: str) -> str | None:
    """The group that a module belongs to."""
    return next((name for name, group in GROUPS.items() if group.has(file)), None)


for _test in sorted(DIAGNOSIS_TESTS.rglob("test_*.py")):
    _file = f"diagnosis/{_test.relative_to(DIAGNOSIS_TESTS).with_name(_test.name.removeprefix('test_'))}"
    if (REPOSITORY / "twin" / _file).exists() and not group_of(f"twin/{_file}"):
        GROUPS[Path(_file).stem] = Group.of(_file, f"diagnosis/{_test.relative_to(DIAGNOSIS_TESTS)}")
