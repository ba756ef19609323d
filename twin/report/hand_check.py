"""Check the sensors of a finger on trials with a hand on it, which no fit uses."""

from functools import lru_cache

from twin.diagnosis import Diagnosis
from twin.foundation.errors import DataError
from twin.shape.pushed_trials import PushedTrialCheck, check_pushed_trials


def hand_check(diagnosis: Diagnosis) -> PushedTrialCheck | None:
    """Compare the sensors under a hand with the measured shapes; None where no trial allows it."""
    return _check_and_notices(diagnosis)[0]


def all_notices(diagnosis: Diagnosis) -> tuple[str, ...]:
    """Return the notices of the diagnosis, and why this check failed if it did."""
    return (*diagnosis.notices, *_check_and_notices(diagnosis)[1])


@lru_cache(maxsize=1)
def _check_and_notices(diagnosis: Diagnosis) -> tuple[PushedTrialCheck | None, tuple[str, ...]]:
    try:
        return check_pushed_trials(diagnosis.recording, diagnosis.calibrated, diagnosis.twin), ()
    except DataError as error:
        return None, (f"the sensors could not be checked on trials under a hand: {error}",)
