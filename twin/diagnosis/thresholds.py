"""Every threshold of the diagnosis: value, unit, reason, and the evidence it came from.

Evidence is a command that reproduces it, a derivation, or "judgement" where it is no more than that. A judgement holds because the
benchmark's table (`python -m tools.benchmarks.diagnosis.attribution`) holds with it; it was not searched for.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

Number = TypeVar("Number", int, float)

BENCHMARK = "python -m tools.benchmarks.diagnosis.attribution --out results/ --sets 300 --seed 13000"


@dataclass(frozen=True)
class Threshold:
    """One row of the table."""

    value: float
    unit: str
    reason: str
    evidence: str


TABLE: dict[str, Threshold] = {}


def _row(name: str, value: Number, unit: str, reason: str, evidence: str) -> Number:
    if name in TABLE:
        raise ValueError(f"threshold {name} is in the table already; give this one a name of its own")
    TABLE[name] = Threshold(value, unit, reason, evidence)
    return value


# ---- split: which trials are sealed ------------------------------------------------------------------------------------------

SEALED = _row(
    "SEALED", 0.25, "of the trials", "enough to report an error by, few enough to leave the fit its conditions",
    "judgement: of 17 trials 4, whose RMS scatters by some 2 % where marker noise alone is left",
)  # fmt: skip
FEW = _row(
    "FEW", 6, "trials", "with fewer, one or two sealed trials say little and the fit needs all: each is sealed in turn",
    "derivation: the RMS of m alike trials scatters by 1 / sqrt(2 m) of its spread from trial to trial; m = 1 below six",
)  # fmt: skip
EDGE = _row(
    "EDGE", 0.1, "of a range", "a trial that alone comes this close to an end of a commanded range alone shows that end",
    "judgement",
)  # fmt: skip
PACE = _row(
    "PACE", 10.0**0.5, "ratio", "pulls whose rates differ by more are different motions to what relaxes",
    "derivation: half of the decade that two rates should span (FAST)",
)  # fmt: skip

# ---- suspicions: what a file may mean otherwise ------------------------------------------------------------------------------

CLEAN = "python -m pytest tests/diagnosis/checks/test_suspicions.py"
FITS = _row(
    "FITS", 0.5, "of the error, and of the motion", "a change to the file that leaves more is no explanation; a robot as described "
    "explains all but a fifth of the motion of a robot as built", CLEAN,
)  # fmt: skip
AS_GOOD = _row(
    "AS_GOOD", 2.0, "ratio", "of what two changes to the file leave: the data alone do not decide between them", "judgement"
)  # fmt: skip
MOST = _row("MOST", 5, "trials", "in which each tendon is pulled, to try a change to the commands on", "judgement")
SAMPLES = _row(
    "SAMPLES", 60, "1", "of each trial, to try a change to the commands on: a mistake of meaning shows in all of them", "judgement"
)  # fmt: skip
FAR_TURN = _row(
    "FAR_TURN", 20.0, "deg", "a camera nobody has aligned is off by less, which is an effect and no mistake", "judgement"
)  # fmt: skip
SHIFTED = _row(
    "SHIFTED", 0.05, "of the robot's reach", "a camera's origin is known better than that where it is known at all", "judgement"
)  # fmt: skip
EARTH = (
    _row("LEAST_GRAVITY", 9.7, "m/s^2", "9.78 at the equator", "derivation: less 0.8 %, for rounding to 9.8 and 9.7"),
    _row("MOST_GRAVITY", 9.9, "m/s^2", "9.83 at the poles", "derivation: and 0.7 % more"),
)
SAME_NOISE = _row(
    "SAME_NOISE", 0.3, "of the noise", "a repeat differs by 0.95 of it in the median", "derivation: 0.6745 sqrt(2) sigma"
)  # fmt: skip
ALIEN = _row(
    "ALIEN", 0.15, "of a distance between markers", "a robot as built is off by 1 %, markers glued on by hand by 10 %", "judgement"
)  # fmt: skip
OTHER_ROBOT = _row(
    "OTHER_ROBOT", 0.03, "of a distance between markers", "one robot keeps it from trial to trial; hundreds of readings of "
    "15 mm good for 0.35 mm have a median good for 0.2 %", "derivation: 0.35 / 15 x 1.25 / sqrt(500), ten times over for bending",
)  # fmt: skip
ROUNDING = _row("ROUNDING", 1.0, "s", "a start written in whole seconds is no overlap", "derivation: one unit")
COARSE = _row("COARSE", 100.0, "s", "between readings: a tenth of a second in ms", "derivation: 1000 x 0.1 s")
DAY_LONG = _row("DAY_LONG", 7200.0, "s", "a trial of more than two hours is rare, of seven seconds in ms usual", "judgement")
SESSION = _row(
    "SESSION", 259200.0, "s", "three days: a session of more than four minutes in ms is longer, one of slow trials is not",
    "derivation: 1000 x 259 s",
)  # fmt: skip
HASTY = _row("HASTY", 0.2, "s", "no tendon-driven robot is moved and read in less", "derivation: a mode of 5 Hz")
HUNDREDS = _row(
    "HUNDREDS", 30.0, "ratio", "between this and its inverse no unit is off by a thousand", "derivation: the root of 1000"
)  # fmt: skip
ASTRAY = _row(
    "ASTRAY", 2.0, "ratio", "of markers' distance from their cloud to that of its points from each other: 0.9 on good days",
    "python -m tools.benchmarks.diagnosis.mistakes SET (a finger's)",
)  # fmt: skip
THICKER = _row(
    "THICKER", 1.25, "ratio", "of a body near its base, seen to described: 0.996 to 1.000 on ten finite element days",
    "python -m tools.benchmarks.diagnosis.mistakes SET (a finger's without markers)",
)  # fmt: skip
MOVED = _row(
    "MOVED", 0.025, "of the motion described", "less, beside noise, is none: half the weakest gain that is called one",
    "derivation: 0.05 / 2",
)  # fmt: skip
ALIVE = _row("ALIVE", 10.0, "standard deviations of noise", "a motion so large cannot be missed", "derivation: 10 sigma")
EXPLAINED = _row("EXPLAINED", 0.5, "of an error", "as FITS: what one pattern must take", "judgement: as FITS")
NOISY = _row(
    "NOISY", 30.0, "ratio", "of scatter to declared noise: heavy tails and an error of the model make a factor of three", CLEAN
)  # fmt: skip
MISSED = _row("MISSED", 0.2, "of the motion", "that a robot as described gets wrong of one as built, as FITS has it", CLEAN)
QUIET = _row("QUIET", 30.0, "ratio", "of declared noise to scatter: a slow error may be ten times the scatter", "judgement")
DROWNED = _row("DROWNED", 10.0, "ratio", "of declared noise to all that the description leaves", "judgement: a factor of 1000")
WORKABLE = (
    _row("COLDEST", 258.15, "K", "a room, or a yard in winter: -15 degC", "judgement"),
    _row("HOTTEST", 323.15, "K", "a room in the sun: 50 degC", "judgement"),
)

# ---- spikes ------------------------------------------------------------------------------------------------------------------

WINDOW = _row("WINDOW", 7, "rows", "a spike lasts three rows at most", "derivation: a median of 2 k + 1 rows passes over k")
SPIKE = _row(
    "SPIKE", 8.0, "typical departures", "Student noise of 5 degrees goes so far once in 7,000 samples",
    "python -m pytest tests/diagnosis/checks/test_spikes.py",
)  # fmt: skip
SHARED = _row(
    "SHARED", 0.25, "of its part of a motion", "another marker that moves less, or another way, was not moved by the body",
    "python -m pytest tests/diagnosis/checks/test_spikes.py",
)  # fmt: skip
RARE = _row("RARE", 0.05, "of a marker's samples", "more than that are no accidents but a fault of the marker", "judgement")

# ---- loops -------------------------------------------------------------------------------------------------------------------

MEETS = _row(
    "MEETS", 0.02, "of the largest command", "commands closer than that are the same ones",
    "derivation: 40 mN of 2 N, four standard deviations of a load cell good for 10 mN",
)  # fmt: skip
CROSSINGS = _row("CROSSINGS", 8, "pairs", "fewer pairs of readings give no error of their mean", "judgement")
LAG = _row(
    "LAG", 4.0, "standard errors", "a loop smaller than that is not said to be there",
    "derivation: two chances in 30,000, over some 20 trials one in a thousand sets",
)  # fmt: skip
MOVING = _row("MOVING", 0.05, "of the fastest rate of a trial", "slower samples have no direction", "judgement")

# ---- no-effect sets of the user's own design ---------------------------------------------------------------------------------

DRAWS = _row(
    "DRAWS", 24, "sets", "a Gumbel law fitted by two moments needs few",
    "derivation: mean + 3.14 std of 24 draws has a standard error of some 0.75 std",
)  # fmt: skip
GUMBEL_99 = _row(
    "GUMBEL_99", 3.137, "standard deviations", "the 99 % quantile of a Gumbel law above its mean",
    "derivation: -sqrt(6) / pi (0.5772 + ln(-ln 0.99))",
)  # fmt: skip
ACCEPT = _row(
    "ACCEPT", 12.0, "2 ln odds", "evidence an effect must bring after k log n: odds of e^6, safe over two dozen candidates",
    "derivation: 24 candidates at odds e^-6 are wrong once in 17 sets of noise before the gates",
)  # fmt: skip
MATERIAL = _row(
    "MATERIAL", 0.13, "sigma", "an effect that moves the prediction by less is not claimed, whatever the statistics say: on 495 "
    "bench days 3 of 361 right claims were smaller, and 13 of 72 wrong ones", "tools/attribution.md; " + BENCHMARK,
)  # fmt: skip
LEFT = _row("LEFT", 0.12, "sigma", "robots as built leave 0.08 at most, of what no parameter spans", BENCHMARK)
LINE = _row("LINE", 30.0, "z-score", "a spectral line where a law was fitted that could leave one", BENCHMARK)
FAINT = _row(
    "FAINT", 1.0 / 3.0, "of a line's bar", "no law was fitted that could leave one; the largest of 40 no-effect days was "
    "half of that", BENCHMARK,
)  # fmt: skip

# ---- evidence ----------------------------------------------------------------------------------------------------------------

PUSHED = _row(
    "PUSHED", 2.0, "readings' noise", "how far a reading is moved to see what it does: larger than rounding, smaller than a bend",
    "judgement",
)  # fmt: skip
SHORT, MIDDLE, LONG = (
    _row(f"MEMORY_{n}", tau, "s", "the recent past that a relaxation may leave, a factor of four apart", "judgement")
    for n, tau in enumerate((2.0, 8.0, 30.0))
)
MEMORY = (SHORT, MIDDLE, LONG)
ROUNDS = _row("ROUNDS", 60, "steps", "of a fixed point, where it does not settle before", "judgement")
SETTLED = _row("SETTLED", 0.05, "of a variance", "a variance that moves by less changes a size by 2.5 %", "derivation: half of it")
NOTHING = _row("NOTHING", 1e-5, "sigma^2", "a component that small, 0.003 sigma, no longer matters", "derivation: against LEFT^2")
LOWEST, HIGHEST = (
    _row(name, value, "sigma^2", "keeps the fixed point finite, far beyond what data show", "derivation: 1e-4 and 100 sigma")
    for name, value in (("LOWEST", 1e-8), ("HIGHEST", 1e4))
)

# ---- search ------------------------------------------------------------------------------------------------------------------

TOP = _row("TOP", 4, "candidates", "of each measure that are refitted", "judgement")
STARTS = _row("STARTS", 2, "starts an effect", "two of one effect, or its starts crowd the others out", "judgement")
WIDTH = _row("WIDTH", 3, "models", "carried from level to level", "judgement")
WHITER = _row("WHITER", 0.5, "of what the best by evidence leave", "half of an error is no smooth part of it", "judgement: as HALF")
BEHIND = _row("BEHIND", 400.0, "2 ln odds", "a model so far behind the best never led after another effect", "judgement")
DEEPEST = _row("DEEPEST", 3, "effects", "at once; four together are hardly ever told apart", "judgement")
DEEPER = _row(
    "DEEPER", 2.0 / 3.0, "of the base's |z|^2 above the noise", "where the best two leave more no third is sought",
    "derivation: of three right ones, found the largest first, the third takes a third at most where they do not bend alike",
)  # fmt: skip
FORM = _row("FORM", 0.15, "of the largest contribution", "a smaller effect may be what the large one's law gets wrong", BENCHMARK)
HOPELESS = _row(
    "HOPELESS", 2.0, "times the least cost", "a fit that could at best end there is not finished; evidence forgives a smooth "
    "error, and that is less than what the best leaves", "judgement",
)  # fmt: skip
PROMISE = _row(
    "PROMISE", 0.25, "of what an effect must bring, in evidence and in size", "what a first-order pattern must promise to be "
    "worth a refit", "derivation: a pattern right to half in size promises a quarter in square",
)  # fmt: skip
STALE = _row(
    "STALE", 0.25, "of what a pattern must promise", "what one of the base's must promise beside other effects to be taken "
    "anew there",
    "judgement: of some 96 that then promised enough, on 14 days, one had promised less (0.04 for 2.6, beside a best of 75)",
)  # fmt: skip
ROUGHLY = _row(
    "ROUGHLY", 2e-4, "of the cost", "the last step's fall at which a refit is weighed; what is left is second order in it",
    "judgement",
)  # fmt: skip

LITTLE = _row(
    "LITTLE", 3.0, "2 ln odds", "or the last step's fall in cost, where readings are few: a quarter of what an effect must bring; "
    "ROUGHLY is more from 15,000 readings on", "judgement: as ROUGHLY",
)  # fmt: skip

# ---- choose and gate ---------------------------------------------------------------------------------------------------------

HALF = _row(
    "HALF", 0.5, "of the structure, or of the squared error left out", "effects that leave more do not explain it", BENCHMARK
)  # fmt: skip
FAR_OFF = _row(
    "FAR_OFF", 2.0, "times its square", "of a trial left out by a step to first order, which the others would hardly make of it: "
    "then it is fitted again without", "judgement: of trials that a law explains leaving one out adds per cents",
)  # fmt: skip
WORSE = _row(
    "WORSE", 1.005, "ratio", "of the headline's error on trials left out; refitting alone moves it by some thousandth, as it does "
    "where an effect shows elsewhere", "python -m pytest tests/diagnosis/search/test_choose.py",
)  # fmt: skip
HALVED = _row("HALVED", 4, "trials", "of fewer a half of the session is hardly more than a trial", "derivation: two and two")
COARSELY = _row(
    "COARSELY", 1e-3, "of the cost", "as ROUGHLY, of fits to half of a session: what they leave of the other is known to a "
    "tenth at best",
    "derivation: the mean square of some ten trials is known to 1 / sqrt(10)",
)  # fmt: skip
FAR = _row(
    "FAR", 4, "sets", "that are fitted to halves of the session: those that err least on trials left out, to first order",
    "judgement: as TOP",
)  # fmt: skip
BESIDE = _row(
    "BESIDE", 0.75, "of the squared error on trials left out", "each effect of a set that is chosen for what it predicts must take "
    "half of what the set must", "derivation: half of HALF",
)  # fmt: skip
BLOCKS = _row("BLOCKS", 4, "parts", "where one trial alone is fitted, it is left out by quarters", "judgement")

# ---- what makes the robot late -----------------------------------------------------------------------------------------------

SUBROWS = _row(
    "SUBROWS", 4, "moments a row", "of a row's path, as straight lines", "derivation: a parabola is off by 1/16 of its bulge"
)
EXACT = _row(
    "EXACT", 1e-4, "of a command's range", "the least noise of a reading that a spline is asked to follow",
    "judgement: four digits are logged"
)  # fmt: skip
EVENLY = _row(
    "EVENLY", 1e-6, "noise^2 / row^3", "the least that a spline gives way: 6e-4 of the noise within a row",
    "derivation: sqrt(q / 3), of a step of one row",
)  # fmt: skip
NEIGHBOUR = _row(
    "NEIGHBOUR", 0.25, "of a neighbour's looseness", "an interval's own, of one sample a tendon, is found to 60 %; with more "
    "corners blur", "python -m tools.lag_or_delay results/",
)  # fmt: skip
SPLINE = _row(
    "SPLINE", 10, "rounds", "of expectation maximisation; after 20 paths are too stiff: outputs were met worse on 7 of 8 days",
    "python -m tools.lag_or_delay results/, neighbours not heard",
)  # fmt: skip
TAILS = _row(
    "TAILS", 4.0, "degrees of freedom", "of Student's t: a corner of a command that no spline sees is an outlier, not a law",
    "judgement"
)  # fmt: skip
LATE_ROWS = _row(
    "LATE_ROWS", 4000, "rows", "of the trials that move fastest: what tells a lag from a delay is there", "judgement: seconds"
)

PROBED = _row(
    "PROBED", 4, "rows", "between readings that a law is probed at", "derivation: as many as a monotone cubic between rows weighs"
)  # fmt: skip
ENDED = _row("ENDED", 0.5, "ratio", "of the most that a lasting change does: a drive at its end does less", "judgement: half")
SHAKEN = _row("SHAKEN", 12, "draws", "of noise that friction is shaken by", "judgement: +- 7 where 81 of |z|^2 are owed")

# ---- judge -------------------------------------------------------------------------------------------------------------------

SHARE = _row("SHARE", 0.15, "of the structure before", "less left over is what a right law's form leaves", BENCHMARK)
MUCH = _row("MUCH", 0.45, "sigma", "structure that counts whatever was there before", BENCHMARK)
ALONE = _row("ALONE", 0.3, "sigma", "structure that counts where no effect was found: a base model may be off by less", BENCHMARK)
EVEN = _row("EVEN", 0.5, "probability", "of a name where a law of its set is at its limit", "judgement: as likely as not")
TEMPER = _row(
    "TEMPER", 20.0, "score a factor e", "the likelihood takes the laws' form for exact, which makes raw odds absurd; calibrated "
    "so that claims at 0.9 are right nine times of ten", BENCHMARK,
)  # fmt: skip
TOLD = _row("TOLD", 0.05, "sigma", "of a smooth part that is the description's own: less is not worth a word", "judgement")
RUNNERS = _row("RUNNERS", 6, "effects", "runners-up a reader looks at", "judgement")

# ---- rigs --------------------------------------------------------------------------------------------------------------------

TURNS = _row("TURNS", 20, "rounds", "of moving trials between two groups; it settles in a few", "judgement")
GROUP = _row("GROUP", 2, "trials", "one alone is that trial's oddity, not another robot", "derivation: its own mean")
WORTH = _row(
    "WORTH",
    0.2,
    "sigma",
    "that a second robot must take off what one leaves",
    "python -m pytest tests/diagnosis/checks/test_mixed_robots.py",
)

# ---- what the data can tell --------------------------------------------------------------------------------------------------

CLEAR = _row("CLEAR", 25.0, "squared standard errors", "seen, told apart or separated: five standard errors", "derivation: 5^2")
INVISIBLE = _row(
    "INVISIBLE", 1e-6, "of a pattern", "what is left of it when the robot's own parameters imitate the rest: rounding",
    "derivation: the square of 1e-3, the relative error of a finite difference",
)  # fmt: skip
RESOLVED = _row("RESOLVED", 8, "samples", "of a pull that show its rate: a jump between two levels is none", "judgement")
STEADY = _row("STEADY", 20.0, "s", "without motion that count as a hold", "judgement: twice the middle memory")
FAST = _row("FAST", 10.0, "ratio", "of the fastest to the slowest pull that counts as two rates", "judgement: a decade")
WARM = _row(
    "WARM", 2.0, "K", "of spread in the room: a softening of 0.5 %/K then moves the tip by 1 %", "derivation: 2 K x 0.5 %/K"
)  # fmt: skip
PULLED = _row("PULLED", 0.2, "of the largest command", "a tendon that moves by less was not pulled", "judgement")
STILL = _row("STILL", 0.02, "of the largest command", "a change from row to row that is none", "judgement: as MEETS")
ONE_WAY = _row("ONE_WAY", 0.2, "of the loading", "less unloading than that is none", "judgement")
LEAP = _row(
    "LEAP", 0.3, "of a command's range", "within one row: a motion is drawn by ten rows or more, a step by one or two", "judgement"
)  # fmt: skip
LEFT_THERE = _row(
    "LEFT_THERE", 1.5, "ratio", "of what is left after leaps to what is left elsewhere: 1 where it is noise, to 5 % from 200 rows",
    "python -m tools.rows_tell 70066 70043 70030",
)  # fmt: skip
DOUBTFUL = _row(
    "DOUBTFUL",
    3.0,
    "standard deviations",
    "of its description a parameter is unlikely beyond",
    "derivation: 0.3 % of healthy ones are",
)

# ---- how trials repeat ----------------------------------------------------------------------------------------------------------

OVERSTATED = _row(
    "OVERSTATED", 3.0, "ratio", "of declared noise to what rows scatter by: a camera's is declared to a factor of two", "judgement"
)  # fmt: skip
LASTING = _row(
    "LASTING", 1.0, "of the noise", "by which repeats differ throughout; load cells that read elsewhere next time make 0.6 on a "
    "bench day without effect (90000)", "judgement",
)  # fmt: skip
RIVAL = _row("RIVAL", 0.8, "of the largest share", "within trials; laws that take as much are not told apart", "judgement")
BREAK = _row("BREAK", 3600.0, "s", "between two trials, after which a robot was left alone or set up anew", "judgement")

# ---- words -------------------------------------------------------------------------------------------------------------------

ALIKE = _row("ALIKE", 1.5, "ratio", "of the largest marker error to the smallest that counts as none", "judgement")
APART = _row(
    "APART", 3.0, "ratio", "of a marker's error to the next that makes it that marker's own: errors along a body grow by some 8/7",
    "derivation: (8/7)^2 for eight markers and an error that grows with the square",
)  # fmt: skip
TWICE = _row(
    "TWICE",
    2.0,
    "ratio",
    "of the jumps at both ends of an interval to any other",
    "python -m pytest tests/diagnosis/explain/test_describe.py",
)
SHUFFLES = _row("SHUFFLES", 999, "orders", "of the trials none of which may show so clear a step", "derivation: 1 in 1,000")
STEP = _row(
    "STEP", 0.2, "of the trials' scatter", "a step in time may leave; of a steady drift the best step leaves a quarter",
    "derivation: a line of slope one less its best step keeps 1/4 of its variance",
)  # fmt: skip
SHOWN = _row("SHOWN", 6, "trials", "named one by one", "judgement")
FELT = _row(
    "FELT", 0.5, "of what is left", "that a force on the tip must take to be named as a possible cause", "judgement: as HALF"
)
PROBE = _row("PROBE", 1e-3, "N", "a force that moves a robot to first order", "derivation: 2 % of the weight of 5.6 g")
NEAR = _row("NEAR", 0.1, "of the error left out", "a known effect must take off to be worth a hint", "judgement")

# ---- the next experiment -----------------------------------------------------------------------------------------------------

MOST_RUNS = _row("MOST_RUNS", 50, "runs", "more than that is no advice", "judgement")
HEAVIEST = _row("HEAVIEST", 0.03, "kg", "nobody is asked to hang more on a robot than that", "judgement")
LEAST_LOAD = _row("LEAST_LOAD", 0.01, "kg", "a payload that bends a bench-sized robot", "judgement")
HELD = _row("HELD", 0.75, "of the largest command", "a step that is held, within what was already commanded", "judgement")

# ---- zeros that jump ---------------------------------------------------------------------------------------------------------

NEARBY = _row("NEARBY", 8, "trials", "before and after a jump that are compared; more of them wander", "judgement")
JUMPED = _row("JUMPED", 0.5, "sigma", "a smaller jump moves no name", "judgement: as MUCH")
RIGID = _row(
    "RIGID", 0.9, "of a step's square", "what a moved camera does to eight markers in a row, of which a turn about the base takes "
    "0.79 at most where it is shifted", "derivation: (sum z)^2 / (8 sum z^2), z = 1..8",
)  # fmt: skip
JUMPS = _row("JUMPS", 4, "jumps", "more of them in a session: nothing there has a zero", "judgement")
FIRST = _row("FIRST", 5, "rows", "of a trial that its zero is taken anew by, to compare", "judgement")
SURE = _row("SURE", 3.0, "standard errors", "of several angles those that jumped by more are named", "judgement")
