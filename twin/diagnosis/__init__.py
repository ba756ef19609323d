"""Which effect, or none, explains what calibration leaves: fitted; chosen by trials left out in turn; reported on sealed ones.

pipeline.py    the stages in order

look.py        the robot as described, and suspicions about what the files mean
calibrate.py   the noise, and the robot's own parameters
screen.py      what each effect would do, what noise alone would show, what the design can tell
search.py      beam search over sets of effects
choose.py      the set that predicts trials left out
gate.py        what is too small, or cannot be told apart
settle.py      of two that cannot be told apart the likelier, where one of them is there
judge.py       the verdict, the claims, how sure they are
describe.py    what is left, in words
seal.py        the error on trials that neither fit nor choice has seen

thresholds.py  every threshold, its reason and its evidence
"""

from twin.diagnosis.checks.preview import DataPreview, preview_data
from twin.diagnosis.checks.suspicions import Suspicion
from twin.diagnosis.diagnosis import Claim, Diagnosis, Errors, Fold, Settings
from twin.diagnosis.pipeline import calibration, diagnose

__all__ = [
    "Claim",
    "DataPreview",
    "Diagnosis",
    "Errors",
    "Fold",
    "Settings",
    "Suspicion",
    "calibration",
    "diagnose",
    "preview_data",
]
