"""The thresholds that decide a diagnosis: value, unit, reason, and the evidence for each.

Evidence is a command that reproduces it, a derivation, or "judgement". A judgement was not optimised; the benchmark's results
(`python -m tools.benchmarks.diagnosis.days.attribution`) hold with it.
"""

from dataclasses import dataclass
from typing import TypeVar

Number = TypeVar("Number", int, float)

ATTRIBUTION_BENCHMARK = "python -m tools.benchmarks.diagnosis.days.attribution --out results/ --sets 300 --seed 13000"
SUSPICIONS_TEST = "python -m pytest tests/diagnosis/checks/suspicions/test_suspicions.py"
SPIKES_TEST = "python -m pytest tests/diagnosis/checks/test_spikes.py"


@dataclass(frozen=True)
class Threshold:
    """One row of the table."""

    value: float
    unit: str
    reason: str
    evidence: str


THRESHOLDS: dict[str, Threshold] = {}


def _row(name: str, value: Number, unit: str, reason: str, evidence: str) -> Number:
    if name in THRESHOLDS:
        raise ValueError(f"threshold {name} is in the table already; give this one a name of its own")
    THRESHOLDS[name] = Threshold(value, unit, reason, evidence)
    return value


# fmt: off
# ---- thin: rows of long logs that are used --------------------------------------------------------------------------------------

ROWS_THAT_SUFFICE = _row("ROWS_THAT_SUFFICE", 5000, "rows", "several times those of a day of the bench, which decide its verdicts",
    "judgement")
FEWEST_ROWS_OF_TRIAL = _row("FEWEST_ROWS_OF_TRIAL", 200, "rows", "enough for the shape of a loop", "judgement")
MOTION_BETWEEN_ROWS = _row("MOTION_BETWEEN_ROWS", 0.02, "of a command's range", "the path of a hysteresis is followed", "judgement")
MOST_MISSING_TO_THIN = _row("MOST_MISSING_TO_THIN", 0.1, "of the rows",
    "where more lack, devices take turns, and one of them might be left out altogether", "judgement")
ROWS_PER_SECOND_OF_BUDGET = _row("ROWS_PER_SECOND_OF_BUDGET", 25.0, "1/s",
    "with two trials, diagnosed three times, two cores end within 1.3 budgets", "python -m tools.benchmarks.diagnosis.raw_log")

# ---- split: which trials are held out ----------------------------------------------------------------------------------------

HELD_OUT_SHARE = _row("HELD_OUT_SHARE", 0.25, "of the trials",
    "held out: enough to report an error by, few enough to leave the fit its conditions",
    "judgement: of 17 trials 4, whose RMS scatters by some 2 % where marker noise alone is left")
FEWEST_TRIALS_FOR_HELD_OUT = _row("FEWEST_TRIALS_FOR_HELD_OUT", 6, "trials",
    "with fewer, one or two held-out trials show little and the fit needs all: each is held out in turn",
    "derivation: the RMS of m alike trials scatters by 1 / sqrt(2 m) of its spread from trial to trial; m = 1 below six")
LOAD_LEVEL_GAP = _row("LOAD_LEVEL_GAP", 0.1, "of a range",
    "of the loads shown: loads no further apart are one level, left out at once", "judgement")
SAME_RATE_RATIO = _row("SAME_RATE_RATIO", 10.0**0.5, "ratio",
    "pulls whose rates differ by more are different motions to a body that relaxes",
    "derivation: half of the decade that two rates should span (TWO_RATES_RATIO)")

# ---- suspicions: possible mistakes in a file ---------------------------------------------------------------------------------

LEFT_BY_FILE_CHANGE = _row("LEFT_BY_FILE_CHANGE", 0.5, "of the error, and of the motion",
    "a change to the file that leaves more explains nothing; a robot as described leaves a fifth of the motion of one as built",
    SUSPICIONS_TEST)
UNDECIDED_CHANGES_RATIO = _row("UNDECIDED_CHANGES_RATIO", 2.0, "ratio",
    "of the errors that two changes to the file leave: closer ones cannot be separated by the data", "judgement")
TRIALS_TO_TRY_COMMANDS = _row("TRIALS_TO_TRY_COMMANDS", 5, "trials",
    "per tendon that pull it, on which a change to the commands is tried", "judgement")
SAMPLES_TO_TRY_COMMANDS = _row("SAMPLES_TO_TRY_COMMANDS", 60, "1",
    "of each trial, on which a change to the commands is tried: a misread file shows in all of them", "judgement")
LARGEST_CAMERA_TURN = _row("LARGEST_CAMERA_TURN", 20.0, "deg",
    "the error of a camera that was not aligned, which is an effect; a larger turn is a mistake", "judgement")
LARGEST_CAMERA_SHIFT = _row("LARGEST_CAMERA_SHIFT", 0.05, "of the robot's reach",
    "a camera's origin is known better than that, or not at all", "judgement")
GRAVITY_RANGE = (
    _row("LEAST_GRAVITY", 9.7, "m/s^2", "9.78 at the equator", "derivation: less 0.8 %, for rounding to 9.8 and 9.7"),
    _row("MOST_GRAVITY", 9.9, "m/s^2", "9.83 at the poles", "derivation: and 0.7 % more"),
)
GONE_ON = _row("GONE_ON", 0.5, "of a drive's range",
    "after a joint has come to its end; a joint that sticks or stiffens goes on, if little", "judgement")
HALVINGS_FOR_ZERO = _row("HALVINGS_FOR_ZERO", 8, "halvings of the largest length",
    "the least other zero is then known to 0.4 % of the travel", "derivation: 2^-8")
COPIED_TRIAL_DIFFERENCE = _row("COPIED_TRIAL_DIFFERENCE", 0.3, "of the noise",
    "two trials that differ by less are copies; a repeat differs by 0.95 of it in the median",
    "derivation: 0.6745 sqrt(2) sigma")
MARKER_SPACING_ERROR = _row("MARKER_SPACING_ERROR", 0.15, "of a distance between markers",
    "a robot as built is off by 1 %, markers glued on by hand by 10 %", "judgement")
MARKER_SPACING_CHANGE = _row("MARKER_SPACING_CHANGE", 0.03, "of a distance between markers",
    "one robot keeps it from trial to trial; hundreds of readings of 15 mm good for 0.35 mm have a median good for 0.2 %",
    "derivation: 0.35 / 15 x 1.25 / sqrt(500), ten times over for bending")
START_TIME_ROUNDING = _row("START_TIME_ROUNDING", 1.0, "s", "a start written in whole seconds is no overlap",
    "derivation: one unit")
LONGEST_SAMPLE_INTERVAL = _row("LONGEST_SAMPLE_INTERVAL", 100.0, "s", "a longer one is a tenth of a second written in ms",
    "derivation: 1000 x 0.1 s")
LONGEST_TRIAL = _row("LONGEST_TRIAL", 7200.0, "s", "a trial of two hours is rare, one of seven seconds written in ms is usual",
    "judgement")
LONGEST_SESSION = _row("LONGEST_SESSION", 259200.0, "s",
    "three days: a session of four minutes written in ms is longer, one of slow trials is not", "derivation: 1000 x 259 s")
SHORTEST_TRIAL = _row("SHORTEST_TRIAL", 0.2, "s", "no tendon-driven robot is moved and read in less",
    "derivation: a mode of 5 Hz")
UNIT_MISTAKE_RATIO = _row("UNIT_MISTAKE_RATIO", 30.0, "ratio", "between this and its inverse no unit is off by a thousand",
    "derivation: the root of 1000")
CLOUD_DISTANCE_RATIO = _row("CLOUD_DISTANCE_RATIO", 2.0, "ratio",
    "of the markers' distance from their point cloud to the distance between its points: 0.9 on good sets",
    "python -m tools.benchmarks.diagnosis.mistakes SET (a finger's)")
CLOUD_WIDTH_RATIO = _row("CLOUD_WIDTH_RATIO", 1.25, "ratio",
    "of the body's width near its base, seen to described: 0.996 to 1.000 on ten finite element sets",
    "python -m tools.benchmarks.diagnosis.mistakes SET (a finger's without markers)")
LEAST_MOTION_SHARE = _row("LEAST_MOTION_SHARE", 0.025, "of the motion described",
    "less, beside noise, counts as no motion: half the weakest gain that counts as one", "derivation: 0.05 / 2")
WALK_OF_HEADING = _row("WALK_OF_HEADING", 5.0, "times the change of tilt",
     "of an IMU's heading while commands hold: a body that still moves tilts about as much as it turns; of one public IMU 20 times",
     "python -m tools.benchmarks.hardware.imu_robot FOLDER OUT")
HELD_COMMAND_RANGE = _row("HELD_COMMAND_RANGE", 0.01, "of a command's range", "within it a command holds", "judgement")
FEWEST_HELD_ROWS = _row("FEWEST_HELD_ROWS", 10, "rows", "a command held for fewer shows no rest", "judgement")
UNMISSABLE_MOTION = _row("UNMISSABLE_MOTION", 10.0, "standard deviations of noise", "a motion so large cannot be missed",
    "derivation: 10 sigma")
LEFT_BY_PATTERN = _row("LEFT_BY_PATTERN", 0.5, "of an error", "as LEFT_BY_FILE_CHANGE, for one pattern",
    "judgement: as LEFT_BY_FILE_CHANGE")
UNDERSTATED_NOISE_RATIO = _row("UNDERSTATED_NOISE_RATIO", 30.0, "ratio",
    "of scatter to declared noise: heavy tails and model errors explain a factor of three", SUSPICIONS_TEST)
NOMINAL_MOTION_ERROR = _row("NOMINAL_MOTION_ERROR", 0.2, "of the motion",
    "the error of a robot as described about one as built, as in LEFT_BY_FILE_CHANGE", SUSPICIONS_TEST)
SUSPECT_NOISE_RATIO = _row("SUSPECT_NOISE_RATIO", 30.0, "ratio",
    "of declared noise to scatter: a slow error may be ten times the scatter", "judgement")
HIDING_NOISE_RATIO = _row("HIDING_NOISE_RATIO", 10.0, "ratio", "of declared noise to all that the description leaves",
    "judgement: a factor of 1000")
CHANCE_OF_REPEATS = _row("CHANCE_OF_REPEATS", 1e-3, "a channel",
    "that a run of equal readings is no accident: a set of thirty channels has one in thirty times as many sets",
    "python -m pytest tests/diagnosis/checks/suspicions/test_no_readings.py")
COUNTER_BITS = (
    _row("FEWEST_COUNTER_BITS", 8, "bits", "no counter of an encoder or converter rolls over sooner", "judgement"),
    _row("MOST_COUNTER_BITS", 33, "bits", "one more than the widest counter that rolls over in a session", "judgement"),
)
ROOM_TEMPERATURE_RANGE = (
    _row("COLDEST_ROOM", 258.15, "K", "a room, or a yard in winter: -15 degC", "judgement"),
    _row("HOTTEST_ROOM", 323.15, "K", "a room in the sun: 50 degC", "judgement"),
)

# ---- spikes ------------------------------------------------------------------------------------------------------------------

SPIKE_WINDOW = _row("SPIKE_WINDOW", 7, "rows", "a spike lasts three rows at most",
    "derivation: a median of 2 k + 1 rows passes over k")
SPIKE_SIZE = _row("SPIKE_SIZE", 8.0, "typical departures", "Student noise of 5 degrees goes so far once in 7,000 samples",
    SPIKES_TEST)
SHARED_MOTION_SHARE = _row("SHARED_MOTION_SHARE", 0.25, "of its part of a motion",
    "another marker that moves less, or in another direction, was not moved by the body", SPIKES_TEST)
MOST_SPIKES_SHARE = _row("MOST_SPIKES_SHARE", 0.05, "of a marker's samples",
    "more than that are a fault of the marker, not accidents", "judgement")

# ---- loops -------------------------------------------------------------------------------------------------------------------

SAME_COMMAND_DISTANCE = _row("SAME_COMMAND_DISTANCE", 0.02, "of the largest command",
    "commands closer than that are the same ones",
    "derivation: 40 mN of 2 N, four standard deviations of a load cell good for 10 mN")
FEWEST_LOOP_CROSSINGS = _row("FEWEST_LOOP_CROSSINGS", 8, "pairs", "fewer pairs of readings give no error of their mean",
    "judgement")
LOOP_SIGNIFICANCE = _row("LOOP_SIGNIFICANCE", 4.0, "standard errors", "a smaller loop is not reported",
    "derivation: two chances in 30,000, over some 20 trials one in a thousand sets")
MOVING_RATE_SHARE = _row("MOVING_RATE_SHARE", 0.05, "of the fastest rate of a trial", "slower samples have no direction",
    "judgement")

# ---- no-effect sets of the user's own design ---------------------------------------------------------------------------------

NO_EFFECT_DRAWS = _row("NO_EFFECT_DRAWS", 24, "sets", "a Gumbel distribution fitted by two moments needs few",
    "derivation: mean + 3.14 std of 24 draws has a standard error of some 0.75 std")
GUMBEL_99_QUANTILE = _row("GUMBEL_99_QUANTILE", 3.137, "standard deviations",
    "the 99 % quantile of a Gumbel distribution above its mean", "derivation: -sqrt(6) / pi (0.5772 + ln(-ln 0.99))")
LEAST_EVIDENCE = _row("LEAST_EVIDENCE", 12.0, "2 ln odds",
    "evidence that an effect must have after k log n: odds of e^6, safe over two dozen candidates",
    "derivation: 24 candidates at odds e^-6 are wrong once in 17 sets of noise before the gates")
LEAST_CONTRIBUTION = _row("LEAST_CONTRIBUTION", 0.13, "sigma",
    "an effect that moves the prediction by less is not claimed, whatever the statistics say: on 495 simulated sets 3 of 361 right "
    "claims were smaller, and 13 of 72 wrong ones", "tools/evidence/diagnosis.md; " + ATTRIBUTION_BENCHMARK)
STRUCTURE_AS_BUILT = _row("STRUCTURE_AS_BUILT", 0.12, "sigma",
    "robots as built leave at most 0.08 of smooth error that no parameter explains", ATTRIBUTION_BENCHMARK)
LARGEST_SPECTRAL_LINE = _row("LARGEST_SPECTRAL_LINE", 30.0, "z-score",
    "of a spectral line in the residual, where an effect was fitted that could leave one", ATTRIBUTION_BENCHMARK)
FAINT_LINE_SHARE = _row("FAINT_LINE_SHARE", 1.0 / 3.0, "of a line's limit",
    "where no effect was fitted that could leave a line; of 40 sets without effect the largest was half", ATTRIBUTION_BENCHMARK)

# ---- evidence ----------------------------------------------------------------------------------------------------------------

READING_STEP = _row("READING_STEP", 2.0, "readings' noise",
    "by which a reading is changed to find its influence: larger than rounding, small against nonlinearity", "judgement")
SHORT_MEMORY, MIDDLE_MEMORY, LONG_MEMORY = (
    _row(f"MEMORY_{n}", tau, "s", "of a relaxation that may be left in the error, a factor of four apart", "judgement")
    for n, tau in enumerate((2.0, 8.0, 30.0))
)
MEMORY_TIMES = (SHORT_MEMORY, MIDDLE_MEMORY, LONG_MEMORY)
FIXED_POINT_ROUNDS = _row("FIXED_POINT_ROUNDS", 60, "steps", "of a fixed-point iteration, unless it converges before", "judgement")
SETTLED_VARIANCE_CHANGE = _row("SETTLED_VARIANCE_CHANGE", 0.05, "of a variance",
    "a variance that changes by less changes a size by 2.5 %", "derivation: half of it")
NEGLIGIBLE_VARIANCE = _row("NEGLIGIBLE_VARIANCE", 1e-5, "sigma^2", "a component that small, 0.003 sigma, no longer matters",
    "derivation: against STRUCTURE_AS_BUILT^2")
LEAST_VARIANCE, LARGEST_VARIANCE = (
    _row(name, value, "sigma^2", "keeps the fixed point finite, far beyond what data show", "derivation: 1e-4 and 100 sigma")
    for name, value in (("LEAST_VARIANCE", 1e-8), ("LARGEST_VARIANCE", 1e4))
)

# ---- search ------------------------------------------------------------------------------------------------------------------

CANDIDATES_REFITTED = _row("CANDIDATES_REFITTED", 4, "candidates", "by each measure that are refitted", "judgement")
STARTS_PER_EFFECT = _row("STARTS_PER_EFFECT", 2, "starts an effect", "more of one effect would crowd the others out", "judgement")
BEAM_WIDTH = _row("BEAM_WIDTH", 3, "models", "carried from level to level", "judgement")
WHITER_MODEL_LEAVES = _row("WHITER_MODEL_LEAVES", 0.5, "of what the best by evidence leave",
    "a model that leaves less is carried too: half of an error is no smooth part of it", "judgement: as LEFT_BY_EFFECTS")
LARGEST_SCORE_GAP = _row("LARGEST_SCORE_GAP", 400.0, "2 ln odds", "a model further behind the best never led after another effect",
    "judgement")
MOST_EFFECTS = _row("MOST_EFFECTS", 2, "effects",
    "at once: a third was wrong on four of 106 days and right on one, beside a wrong second; a twin with two is diagnosed again",
    "tools/evidence/diagnosis.md; python -m tools.benchmarks.diagnosis.ablation --out results/ --sets 120 --seed 36000")
LAW_FORM_SHARE = _row("LAW_FORM_SHARE", 0.15, "of the largest contribution",
    "a smaller effect may be an error of the large one's equation", ATTRIBUTION_BENCHMARK)
HOPELESS_COST_RATIO = _row("HOPELESS_COST_RATIO", 2.0, "times the least cost",
    "a fit that could at best end there is stopped; the smooth error that evidence does not penalise is smaller",
    "judgement")
UNEXPLAINED_RATIO = _row("UNEXPLAINED_RATIO", 2.0, "times the noise, of |z|^2",
    "a motion of which the best candidate leaves more is not said to be unexplained before each effect was fitted alone",
    "judgement")
PROMISED_SHARE = _row("PROMISED_SHARE", 0.25, "of what an effect must have, in evidence and in size",
    "that a first-order pattern must promise to be worth a refit",
    "derivation: a pattern right to half in size promises a quarter in square")
REUSED_PROMISE_SHARE = _row("REUSED_PROMISE_SHARE", 0.25, "of what a pattern must promise",
    "that a pattern of the base must promise beside other effects to be computed again there",
    "judgement: of some 96 that then promised enough, on 14 sets, one had promised less (0.04 for 2.6, beside a best of 75)")
MOST_DOUBLINGS = _row("MOST_DOUBLINGS", 5, "doublings and halvings",
    "of the first amplitude of a motion's effect; a thirtieth is small, thirty times is large", "judgement")
REFIT_TOLERANCE = _row("REFIT_TOLERANCE", 2e-4, "of the cost",
    "by which the last step of a refit falls; what is left is second order in it", "judgement")
REFIT_SCORE_TOLERANCE = _row("REFIT_SCORE_TOLERANCE", 3.0, "2 ln odds",
    "the same for few readings: a quarter of what an effect must have; REFIT_TOLERANCE is more from 15,000 readings on",
    "judgement: as REFIT_TOLERANCE")

# ---- choose and gate ---------------------------------------------------------------------------------------------------------

LEFT_BY_EFFECTS = _row("LEFT_BY_EFFECTS", 0.5, "of the structure, or of the squared error left out",
    "effects that leave more do not explain it", ATTRIBUTION_BENCHMARK)
FIRST_ORDER_LIMIT = _row("FIRST_ORDER_LIMIT", 2.0, "times its square",
    "of a left-out trial's error after a first-order step: beyond it the others are fitted again without the trial",
    "judgement: leaving out one of the trials that an effect explains adds some per cent")
WORSE_ERROR_RATIO = _row("WORSE_ERROR_RATIO", 1.005, "ratio",
    "of the headline's error on left-out trials; refitting alone changes it by some 0.001, also where an effect shows elsewhere",
    "python -m pytest tests/diagnosis/search/test_choose.py")
FEWEST_TRIALS_TO_HALVE = _row("FEWEST_TRIALS_TO_HALVE", 4, "trials", "with fewer, half of the session is hardly more than a trial",
    "derivation: two and two")
HALF_SESSION_TOLERANCE = _row("HALF_SESSION_TOLERANCE", 1e-3, "of the cost",
    "as REFIT_TOLERANCE, of fits to half of a session, whose error on the other half is known to a tenth at best",
    "derivation: the mean square of some ten trials is known to 1 / sqrt(10)")
SETS_FITTED_TO_HALVES = _row("SETS_FITTED_TO_HALVES", 4, "sets",
    "that are fitted to halves of the session: those with the least first-order error on trials left out",
    "judgement: as CANDIDATES_REFITTED")
LEFT_BY_EACH_EFFECT = _row("LEFT_BY_EACH_EFFECT", 0.75, "of the squared error on left-out trials",
    "each effect of a set chosen for its predictions must remove half of what the set must",
    "derivation: half of LEFT_BY_EFFECTS")
PARTS_OF_ONE_TRIAL = _row("PARTS_OF_ONE_TRIAL", 4, "parts", "a single fitted trial is left out by quarters",
    "judgement")

# ---- lag or delay ------------------------------------------------------------------------------------------------------------

MOMENTS_PER_ROW = _row("MOMENTS_PER_ROW", 4, "moments a row", "of a command between rows, joined by straight lines",
    "derivation: a parabola is off by 1/16 of its bulge")
LEAST_COMMAND_NOISE = _row("LEAST_COMMAND_NOISE", 1e-4, "of a command's range",
    "the least noise of a reading that a spline is asked to follow", "judgement: four digits are logged")
LEAST_SPLINE_COMPLIANCE = _row("LEAST_SPLINE_COMPLIANCE", 1e-6, "noise^2 / row^3",
    "the least compliance of a spline: 6e-4 of the noise within a row", "derivation: sqrt(q / 3), of a step of one row")
NEIGHBOUR_WEIGHT = _row("NEIGHBOUR_WEIGHT", 0.25, "of a neighbour's looseness",
    "an interval's own looseness, from one sample a tendon, is known to 60 %; a larger share blurs corners",
    "judgement: on simulated sets with a lag or a delay")
SPLINE_ROUNDS = _row("SPLINE_ROUNDS", 10, "rounds",
    "of expectation maximisation; after 20 splines are too stiff: outputs were predicted worse on 7 of 8 sets",
    "judgement: on simulated sets with a lag or a delay, without NEIGHBOUR_WEIGHT")
STUDENT_DEGREES = _row("STUDENT_DEGREES", 4.0, "degrees of freedom",
    "of Student's t: a corner of a command that no spline follows is an outlier, not an effect", "judgement")
LAG_OR_DELAY_ROWS = _row("LAG_OR_DELAY_ROWS", 4000, "rows",
    "of the trials that move fastest, which separate a lag from a delay best", "judgement: seconds")

# ---- noise of the inputs -----------------------------------------------------------------------------------------------------

PROBED_ROWS = _row("PROBED_ROWS", 4, "rows", "between readings that are changed together to find what an effect transmits",
    "derivation: as many as a monotone cubic between rows weighs")
DRIVE_END_RATIO = _row("DRIVE_END_RATIO", 0.5, "ratio",
    "to the largest response to a lasting change: a drive at the end of its range responds less", "judgement: half")
FRICTION_NOISE_DRAWS = _row("FRICTION_NOISE_DRAWS", 12, "draws", "of noise under which friction is simulated again",
    "judgement: +- 7 where the correction is 81 of |z|^2")

# ---- judge -------------------------------------------------------------------------------------------------------------------

MISSED_TRIAL_RATIO = _row("MISSED_TRIAL_RATIO", 2.0, "ratio", "to the noise floor: a held-out trial off by more is missed",
    "derivation: the RMS of ten rows of noise alone stays below it with 99.998 %")
LEFTOVER_SHARE = _row("LEFTOVER_SHARE", 0.15, "of the structure before",
    "less left over may be an error of a right effect's equation", ATTRIBUTION_BENCHMARK)
LARGE_STRUCTURE = _row("LARGE_STRUCTURE", 0.45, "sigma", "structure that counts whatever was there before", ATTRIBUTION_BENCHMARK)
LARGE_STRUCTURE_WITHOUT_EFFECT = _row("LARGE_STRUCTURE_WITHOUT_EFFECT", 0.3, "sigma",
    "structure that counts where no effect was found: a base model may be off by less", ATTRIBUTION_BENCHMARK)
EVEN_CHANCE = _row("EVEN_CHANCE", 0.5, "probability", "of a claim where an effect of its set is at its limit",
    "judgement: as likely as not")
SCORE_TEMPERATURE = _row("SCORE_TEMPERATURE", 20.0, "score a factor e",
    "the likelihood takes an effect's equation for exact, which makes raw odds far too large; calibrated so that claims at 0.9 are "
    "right nine times of ten", ATTRIBUTION_BENCHMARK)
STRUCTURE_WORTH_A_WORD = _row("STRUCTURE_WORTH_A_WORD", 0.05, "sigma",
    "of smooth error that the description's own accuracy explains; less is not reported", "judgement")
RUNNERS_UP_SHOWN = _row("RUNNERS_UP_SHOWN", 6, "effects", "runners-up in a report", "judgement")

# ---- trials of two robots ----------------------------------------------------------------------------------------------------

GROUPING_ROUNDS = _row("GROUPING_ROUNDS", 20, "rounds", "of moving trials between two groups; it converges in a few", "judgement")
FEWEST_TRIALS_IN_GROUP = _row("FEWEST_TRIALS_IN_GROUP", 2, "trials", "a single trial is an outlier, not another robot",
    "derivation: its own mean")
SECOND_ROBOT_GAIN = _row("SECOND_ROBOT_GAIN", 0.2, "sigma", "by which a second robot must lower what one robot leaves",
    "python -m pytest tests/diagnosis/checks/test_mixed_robots.py")

# ---- what the data can show --------------------------------------------------------------------------------------------------

CLEAR_CHI_SQUARE = _row("CLEAR_CHI_SQUARE", 25.0, "squared standard errors",
    "seen or separated: five standard errors", "derivation: 5^2")
INVISIBLE_PATTERN_SHARE = _row("INVISIBLE_PATTERN_SHARE", 1e-6, "of a pattern",
    "the rounding error left when the robot's own parameters imitate all of it",
    "derivation: the square of 1e-3, the relative error of a finite difference")
SAMPLES_TO_SHOW_RATE = _row("SAMPLES_TO_SHOW_RATE", 8, "samples",
    "of a pull that show its rate: a jump between two levels has none", "judgement")
SHORTEST_HOLD = _row("SHORTEST_HOLD", 20.0, "s", "without motion that count as a hold", "judgement: twice the middle memory")
TWO_RATES_RATIO = _row("TWO_RATES_RATIO", 10.0, "ratio", "of the fastest to the slowest pull that counts as two rates",
    "judgement: a decade")
LEAST_TEMPERATURE_SPREAD = _row("LEAST_TEMPERATURE_SPREAD", 2.0, "K",
    "of the room's temperature: a softening of 0.5 %/K then moves the tip by 1 %", "derivation: 2 K x 0.5 %/K")
PULLED_TENDON_SHARE = _row("PULLED_TENDON_SHARE", 0.2, "of the largest command", "a tendon that moves by less was not pulled",
    "judgement")
STILL_COMMAND_SHARE = _row("STILL_COMMAND_SHARE", 0.02, "of the largest command",
    "a smaller change from row to row counts as none", "judgement: as SAME_COMMAND_DISTANCE")
LEAST_UNLOADING_SHARE = _row("LEAST_UNLOADING_SHARE", 0.2, "of the loading", "less unloading than that counts as none", "judgement")
COMMAND_STEP_SHARE = _row("COMMAND_STEP_SHARE", 0.3, "of a command's range",
    "within one row: a motion takes ten rows or more, a step one or two", "judgement")
ERROR_AFTER_STEP_RATIO = _row("ERROR_AFTER_STEP_RATIO", 1.5, "ratio",
    "of the error after steps of the command to that elsewhere: 1 where it is noise, to 5 % from 200 rows",
    "judgement: on three simulated sets with a lag or a delay")
UNLIKELY_PARAMETER_DISTANCE = _row("UNLIKELY_PARAMETER_DISTANCE", 3.0, "standard deviations",
    "from its description, beyond which a parameter is unlikely", "derivation: 0.3 % of healthy ones are")

# ---- how trials repeat -------------------------------------------------------------------------------------------------------

OVERSTATED_NOISE_RATIO = _row("OVERSTATED_NOISE_RATIO", 3.0, "ratio",
    "of declared noise to the scatter of rows: a camera's noise is declared to a factor of two", "judgement")
LASTING_DIFFERENCE = _row("LASTING_DIFFERENCE", 1.0, "of the noise",
    "by which repeats differ throughout; drift of load cells between them makes 0.6 on a simulated set without effect",
    "judgement")
RIVAL_SHARE = _row("RIVAL_SHARE", 0.8, "of the largest share", "within trials; effects that explain as much cannot be separated",
    "judgement")
LONG_PAUSE = _row("LONG_PAUSE", 3600.0, "s", "between two trials, after which a robot was left alone or set up again", "judgement")

# ---- words -------------------------------------------------------------------------------------------------------------------

EVEN_MARKER_ERRORS_RATIO = _row("EVEN_MARKER_ERRORS_RATIO", 1.5, "ratio",
    "of the largest marker error to the smallest, below which they are called even", "judgement")
SINGLE_MARKER_ERROR_RATIO = _row("SINGLE_MARKER_ERROR_RATIO", 3.0, "ratio",
    "of a marker's error to the next, beyond which it is that marker's own: errors along a body grow by some 8/7",
    "derivation: (8/7)^2 for eight markers and an error that grows with the square")
BEND_JUMP_RATIO = _row("BEND_JUMP_RATIO", 2.0, "ratio", "of the jumps at both ends of an interval to any other",
    "python -m pytest tests/diagnosis/explain/test_describe.py")
SHUFFLED_ORDERS = _row("SHUFFLED_ORDERS", 999, "orders", "of the trials, none of which may show so clear a step",
    "derivation: 1 in 1,000")
STEP_LEFTOVER_SHARE = _row("STEP_LEFTOVER_SHARE", 0.2, "of the trials' scatter",
    "that a step in time may leave; of a steady drift the best step leaves a quarter",
    "derivation: a line of slope one less its best step keeps 1/4 of its variance")
NAMED_ONE_BY_ONE = _row("NAMED_ONE_BY_ONE", 6, "trials", "named before the rest is counted", "judgement")
TIP_FORCE_SHARE = _row("TIP_FORCE_SHARE", 0.5, "of what is left",
    "that a force on the tip must explain to be named as a possible cause", "judgement: as LEFT_BY_EFFECTS")
PROBE_FORCE = _row("PROBE_FORCE", 1e-3, "N", "a force that moves a robot to first order", "derivation: 2 % of the weight of 5.6 g")
HINT_SHARE = _row("HINT_SHARE", 0.1, "of the error left out", "that a known effect must remove to be worth a hint", "judgement")

# ---- the next experiment -----------------------------------------------------------------------------------------------------

MOST_REPEATS = _row("MOST_REPEATS", 50, "runs", "a trial that needs more is not recommended", "judgement")
HEAVIEST_PAYLOAD = _row("HEAVIEST_PAYLOAD", 0.03, "kg", "the heaviest payload that is recommended", "judgement")
LEAST_PAYLOAD = _row("LEAST_PAYLOAD", 0.01, "kg", "a payload that bends a small robot", "judgement")
SLOW_TRIAL = _row("SLOW_TRIAL", 120.0, "s", "in as long a pull and release, bodies that are not in motion follow in equilibria",
                  "judgement")
HELD_COMMAND_SHARE = _row("HELD_COMMAND_SHARE", 0.75, "of the largest command",
    "a step that is held, within what was already commanded", "judgement")

# ---- zeros that jump ---------------------------------------------------------------------------------------------------------

TRIALS_AROUND_JUMP = _row("TRIALS_AROUND_JUMP", 8, "trials",
    "before and after a jump that are compared; over more of them the mean drifts", "judgement")
LEAST_JUMP = _row("LEAST_JUMP", 0.5, "sigma", "a smaller jump changes no claim", "judgement: as LARGE_STRUCTURE")
RIGID_MOTION_SHARE = _row("RIGID_MOTION_SHARE", 0.9, "of a step's square",
    "what a moved camera does to eight markers in a row, of which a turn about the base takes 0.79 at most where it is shifted",
    "derivation: (sum z)^2 / (8 sum z^2), z = 1..8")
MOST_JUMPS = _row("MOST_JUMPS", 4, "jumps", "with more of them in a session they are not jumps of a zero", "judgement")
ROWS_FOR_ZERO = _row("ROWS_FOR_ZERO", 5, "rows", "of a trial, from which its own zero is taken for comparison", "judgement")
SIGNIFICANT_STANDARD_ERRORS = _row("SIGNIFICANT_STANDARD_ERRORS", 3.0, "standard errors",
    "of several angles those that jumped by more are named", "judgement")
# fmt: on
