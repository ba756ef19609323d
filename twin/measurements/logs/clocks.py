"""Clocks of streams: which to take, its unit, how it runs against the recorder's, and the rate and gaps of its stamps."""

import re
from dataclasses import dataclass

import numpy as np

from twin.measurements.logs.bags.topics import HEADER_CLOCK, LOG_CLOCK, OWN_CLOCK
from twin.measurements.logs.streams import ROW_CLOCK, Clock, Stream

EPOCH_SECONDS = 1e8  # s since 1970: every clock of today reads more
MAX_HEADER_SKEW = 10.0  # s between a header's stamp and the recorder's: more is another clock, not a delay
MAX_RATE = 1e5  # rows a second: more is a mistaken unit
_COUNTER_NAMES = re.compile(r"id|index|idx|frame\w*|sample\w*|seq\w*|count\w*|step\w*|row\w*|tick\w*|n|no|#", re.IGNORECASE)
GAP_STEPS = 10.0  # a gap: more than this many usual steps


@dataclass(frozen=True)
class Timing:
    """How the stamps of a stream run; times in s."""

    rows: int
    rate: float  # rows a second, from the median step; NaN if there is no step
    span: float
    longest_gap: float  # the longest step
    gaps: int  # steps longer than GAP_STEPS usual ones
    equal: int  # rows with the stamp of the row before
    back: int  # rows earlier than the row before


@dataclass(frozen=True)
class ClockChoice:
    """The clock proposed for a stream, and why."""

    name: str
    unit: str  # "?" where the log does not say
    why: str
    rate: str = ""  # of a row clock: "?"


def timing(seconds: np.ndarray) -> Timing:
    """Return how stamps (n,) in s run; missing ones do not count."""
    stamps = seconds[np.isfinite(seconds)]
    steps = np.diff(stamps)
    forward = steps[steps > 0]
    usual = float(np.median(forward)) if len(forward) else np.nan
    longest = float(forward.max()) if len(forward) else 0.0
    span = float(stamps.max() - stamps.min()) if len(stamps) else 0.0
    gaps = int(np.count_nonzero(forward > GAP_STEPS * usual)) if len(forward) else 0
    return Timing(
        len(seconds), 1.0 / usual, span, longest, gaps, int(np.count_nonzero(steps == 0)), int(np.count_nonzero(steps < 0))
    )


def guess_unit(clock: Clock) -> tuple[str, str]:
    """Return in what unit a clock counts, and how that is known; "?" where it cannot be."""
    if clock.unit:
        return clock.unit, "as the log says"
    ticks = clock.ticks[np.isfinite(clock.ticks)]
    if len(ticks) == 0:
        return "?", "no stamp in it"
    first = abs(float(ticks[0]))
    for unit, digits in (("ns", 9), ("us", 6), ("ms", 3), ("s", 0)):
        if EPOCH_SECONDS * 10.0**digits < first < 1e3 * EPOCH_SECONDS * 10.0**digits:
            return unit, f"by its size, {first:.4g}, time since 1970"
    steps = np.diff(ticks)
    if len(steps) and np.any(steps % 1.0) and np.median(steps) < 10.0:
        return "s", f"a guess from its median step, {np.median(steps):.3g}: check the rate"
    return "?", "s, ms, us or ns cannot be told apart"


def choose_clock(stream: Stream, one_clock: bool) -> ClockChoice:
    """Return the clock to take for a stream. `one_clock`: all messages are stamped on one, though not the recorder's."""
    if LOG_CLOCK in stream.clocks:
        own = stamp_clock(stream)
        if not own:
            return ClockChoice(LOG_CLOCK, "ns", "the messages carry no header.stamp")
        skew = describe_skew(stream)
        if one_clock or abs(float(np.median(header_skew(stream)))) < MAX_HEADER_SKEW:
            return ClockChoice(own, "ns", skew)
        aligned = f'{own} with offset = "{float(np.median(header_skew(stream))):.6f} s" keeps its finer spacing'
        return ClockChoice(LOG_CLOCK, "ns", f"{skew}: another clock, so the recorder's is taken; {aligned}")
    for name, clock in stream.clocks.items():
        unit, why = guess_unit(clock)
        return ClockChoice(name, unit, f"unit: {why}")
    if counter := _counter(stream):
        return ClockChoice(counter, "", f"no column of times; {counter} counts the samples", "?")
    return ClockChoice(ROW_CLOCK, "", "no column of times; the rows are counted", "?")


def _counter(stream: Stream) -> str:
    """Return the column of whole numbers that counts the samples, or an empty text."""
    for name, field in stream.fields.items():
        steps = np.diff(field.values) if np.issubdtype(field.values.dtype, np.integer) else np.zeros(1)
        if _COUNTER_NAMES.fullmatch(name.strip()) and len(steps) and steps.min() > 0 and np.median(steps) == 1:
            return name
    return ""


def stamp_clock(stream: Stream) -> str:
    """Return the clock of the stamps that the messages themselves carry, or an empty text."""
    return next((name for name in (HEADER_CLOCK, OWN_CLOCK) if name in stream.clocks), "")


def share_one_clock(streams: list[Stream]) -> bool:
    """Return whether the stamps in all messages are on one clock, such as a simulator's; single, latched messages do not count."""
    several = [each for each in streams if each.count > 2 and LOG_CLOCK in each.clocks]
    if not several or not all(stamp_clock(each) for each in several):
        return False
    skews = [float(np.median(header_skew(each))) for each in several]
    return max(skews) - min(skews) < MAX_HEADER_SKEW


def header_skew(stream: Stream) -> np.ndarray:
    """Return (n,) s by which the recorder's stamps are later than those in the messages."""
    return (stream.clocks[LOG_CLOCK].ticks - stream.clocks[stamp_clock(stream)].ticks) / 1e9


def describe_skew(stream: Stream) -> str:
    """Return how the recorder's clock runs against that of the headers, in words."""
    skew = header_skew(stream)
    low, middle, high = np.percentile(skew, [5, 50, 95])
    words = f"log time is later by {_time(middle)} (90 % within {_time(low)} .. {_time(high)})"
    since = (stream.clocks[LOG_CLOCK].ticks - stream.clocks[LOG_CLOCK].ticks[0]) / 1e9
    if len(skew) > 100 and since[-1] > 10.0:
        drift = float(np.polyfit(since, skew, 1)[0])
        if abs(drift) * since[-1] > 3.0 * max(high - low, 1e-4):
            words += f", and the clocks drift by {1e6 * drift:.0f} us a second"
    return words


def _time(seconds: float) -> str:
    size = abs(seconds)
    if size < 1.0:
        return f"{1e3 * seconds:.3g} ms"
    return f"{seconds:.4g} s"
