"""Times written as text in ways that pyarrow does not read by itself."""

from collections.abc import Sequence
from datetime import datetime

import numpy as np

_FORMATS = (  # no month before a day: 3/4/2024 cannot be told
    "%H:%M:%S.%f", "%Y/%m/%d %H:%M:%S.%f", "%Y/%m/%d %H:%M:%S", "%d.%m.%Y %H:%M:%S.%f", "%d.%m.%Y %H:%M:%S", "%Y-%m-%d-%H:%M:%S.%f",
    "%Y-%m-%d_%H:%M:%S.%f", "%Y-%m-%d %H:%M:%S,%f", "%Y%m%d %H:%M:%S.%f", "%Y%m%d-%H%M%S.%f",
)  # fmt: skip
_EPOCH, _MIDNIGHT = datetime(1970, 1, 1), datetime(1900, 1, 1)


def nanoseconds_of_texts(texts: Sequence[str | None]) -> np.ndarray | None:
    """Return whole nanoseconds since 1970, or since midnight for a time of day; None unless all texts are times of one format."""
    first = texts[0] if texts else None
    for form in _FORMATS if first and first[:1].isdigit() else ():
        try:
            times = [datetime.strptime(text or "", form) for text in texts]
        except ValueError:
            continue
        origin = _MIDNIGHT if form.startswith("%H") else _EPOCH
        return np.array([_microseconds(time, origin) * 1000 for time in times], np.int64)
    return None


def _microseconds(time: datetime, origin: datetime) -> int:
    since = time - origin
    return (since.days * 86400 + since.seconds) * 10**6 + since.microseconds
