"""The diagnosis: which effect, or none, explains what calibration leaves.

pipeline.py     the stages in order: thin -> preview -> calibrate -> screen -> search -> choose -> judge -> held-out error
diagnosis.py    what a diagnosis finds
conclusion.py   what the stages decided before held-out trials are used
fit_context.py  what every stage fits with
budget.py       the time for the search
thinning.py     the rows of a long log that are used
split.py        fitted and held-out trials
held_out.py     the error on trials that neither fit nor choice has used
thresholds.py   every threshold, its reason and its evidence

calibration/    the robot's own parameters                search/    candidates, and sets of effects
noise/          the noise model                           verdict/   which claims stand, and how sure they are
checks/         the data and the design                   explain/   what is left, and the next experiment, in words
evidence/       scores, and what noise alone would show
"""

from twin.diagnosis.checks.preview import DataPreview, preview_data
from twin.diagnosis.checks.suspicions import Suspicion
from twin.diagnosis.diagnosis import Claim, Diagnosis, Errors, Fold, Settings
from twin.diagnosis.pipeline import calibrate_twin as calibrate
from twin.diagnosis.pipeline import calibrated_fit, diagnose

__all__ = [
    "Claim",
    "DataPreview",
    "Diagnosis",
    "Errors",
    "Fold",
    "Settings",
    "Suspicion",
    "calibrate",
    "calibrated_fit",
    "diagnose",
    "preview_data",
]
