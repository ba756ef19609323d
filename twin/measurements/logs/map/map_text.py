"""The commented map that an import begins with: what is in the log, proposals, and "?" where only the user knows."""

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from twin.measurements.logs.clocks import MAX_RATE, ClockChoice, Timing, choose_clock, share_one_clock, timing
from twin.measurements.logs.guess import UNKNOWN, Guess, guess_fields
from twin.measurements.logs.map.map_file import MAP_FORMAT
from twin.measurements.logs.streams import Field, Log, Stream
from twin.measurements.logs.tables.folder import stem
from twin.measurements.parsing.toml_text import toml_value

_HEAD = """\
# How `twin import` reads {name} ({format}).
# Fill in every "?", correct the guesses, remove the # before channels to import and put one before those not to. Then:
#   twin import {name} --map {map} --out SET
"""
_TRIALS = """
# Trials. Without `cut` each take is one trial: {takes}. Else one of:
# cut = {{ gap = "1 s" }}                                     # a pause of all streams{gaps}
# cut = {{ every = "25 s" }}                                  # a continuous log, into trials of this length
# cut = {{ stream = "S" }}                                    # each row of a stream of marks begins a trial{events}
# cut = {{ stream = "S", field = "F" }}                       # each change of a field begins a trial{marks}
# cut = {{ stream = "S", field = "F", only = 1 }}             # and only the rows while it has this value are kept
"""
_STREAMS = """
# Clocks. All streams of a take must share one time line; its first stamp becomes 0 s. Further keys: offset = "20 ms" (added to the
# stamps), equal_stamps = "mean" or "first", backward_stamps = "sort" or "cut"; without these such stamps are refused.
"""
_CHANNELS = """
# Channels. quantity: what it is (models/measurements.md lists all). role: input drives the twin, output is compared with it,
# context is known. unit: of the numbers in the log. Further keys: name (the column; else the quantity), noise (one standard
# deviation), scale and offset (reading * scale + offset, in the unit; scale = -1 turns an axis).
"""


def map_text(log: Log, map_name: str) -> str:
    """Return the text of a map for a log."""
    streams = log.streams
    one_clock = share_one_clock([each[0] for each in streams.values()])
    takes = f"{len(log.takes)} ({', '.join(take.name for take in log.takes[:4])}{', ...' if len(log.takes) > 4 else ''})"
    choices = {name: choose_clock(found[0], one_clock) for name, found in streams.items()}
    title, log_name = _comment(stem(log.path)), _comment(str(log.path))
    lines = [_HEAD.format(name=log_name, format=_comment(log.format), map=_comment(map_name))]
    lines += [f"# {_comment(note)}" for note in log.notes[:20]]
    lines += [f"# not read: {_comment(topic)} ({_comment(why)})" for topic, why in log.unread.items()]
    lines += ["", f'format = "{MAP_FORMAT}"', f'robot = "{UNKNOWN}"    # a robot\'s name, or the path to its folder from this file']
    lines += [
        f"title = {toml_value(title)}",
        f'source = "{UNKNOWN}"   # hardware or simulation, free text may follow after a colon',
    ]
    lines.append(
        _TRIALS.format(takes=_comment(takes), gaps=_longest_gaps(log, choices), events=_events(streams), marks=_marks(streams))
    )
    lines += [_STREAMS, "stream = ["]
    for name, found in streams.items():
        lines += _stream_lines(found[0], choices[name])
    lines += ["]", _CHANNELS, "channel = ["]
    proposals = {name: guess_fields(found[0]) for name, found in streams.items()}
    together = _together(log)
    proposals = {
        name: {field: replace(each, proposed=each.proposed and name in together) for field, each in of_stream.items()}
        for name, of_stream in proposals.items()
    }
    taken = _repeated(proposals)
    for name, found in streams.items():
        units = "; ROS counts in rad, for a sliding joint in m" if found[0].kind.endswith("JointState") else ""
        lines.append(f"  # {_comment(name)}: {_comment(found[0].kind)}{units}")
        lines += _channel_lines(found[0], proposals[name], taken)
    return "\n".join([*lines, "]", ""])


def stream_timing(stream: Stream, choice: ClockChoice) -> Timing | None:
    """Return how a stream's stamps run on a clock, or None where its unit is not known."""
    clock = stream.clock(choice.name)
    if clock is None or choice.unit in ("", UNKNOWN):
        return None
    return timing(clock.seconds(choice.unit, clock.first_ns(choice.unit)))


def _stream_lines(stream: Stream, choice: ClockChoice) -> list[str]:
    said = stream_timing(stream, choice)
    about = f"{stream.count} rows"
    if said is not None and said.rate == said.rate:
        about += f", {said.rate:.4g} a second, {said.span:.4g} s, longest step {said.longest_gap:.3g} s"
        about += f", {said.equal} EQUAL STAMPS" if said.equal else ""
        about += f", {said.back} BACKWARD STAMPS" if said.back else ""
        about += " (IS THE UNIT RIGHT?)" if said.rate > MAX_RATE else ""
    entry: dict[str, object] = {"name": stream.name, "clock": choice.name}
    if choice.rate:
        entry["rate"] = choice.rate
    else:
        entry["time_unit"] = choice.unit
    others = [f'"{_comment(name)}"' for name in stream.clocks if name != choice.name][:3]
    lines = [f"  # {_comment(about)}; {_comment(choice.why)}{'; other clocks: ' + ', '.join(others) if others else ''}"]
    lines += [f"  # {_comment(remark)}" for remark in stream.remarks]
    return [*lines, f"  {_inline(entry)},"]


def _channel_lines(stream: Stream, proposals: Mapping[str, Guess], repeated: set[str]) -> list[str]:
    rows = []
    for name, each in stream.fields.items():
        if each.labels or name in stream.clocks or name not in proposals:
            continue
        guess = proposals[name]
        silent = not np.any(np.isfinite(each.values))
        entry = {"stream": stream.name, "field": name, "quantity": guess.quantity, "role": guess.role, "unit": guess.unit}
        if guess.quantity in repeated:
            entry["name"] = re.sub(r"[^\w.\[\]-]+", "_", name).strip("_") or "column"
        chosen = guess.proposed and not silent
        about = describe_range(each) + ("" if guess.sure or not chosen else "; a guess")
        rows.append((f"  {'' if chosen else '# '}{_inline(entry)},", about))
    width = min(max((len(text) for text, _ in rows), default=0), 150)
    return [f"{text.ljust(width)}  # {_comment(about)}" for text, about in rows]


def describe_range(field: Field) -> str:
    """Return the range of a field's readings in words."""
    values = field.values[np.isfinite(field.values)]
    if len(values) == 0:
        return "no reading"
    low, high = float(values.min()), float(values.max())
    missing = 1.0 - len(values) / len(field.values)
    words = f"always {low:.6g}" if low == high else f"{low:.4g} .. {high:.4g}"
    return words + (f", {100 * missing:.0f} % empty" if missing > 0.005 else "")


def _repeated(proposals: Mapping[str, Mapping[str, Guess]]) -> set[str]:
    """Return the quantities that are proposed more than once."""
    all_of_them = [
        each.quantity for found in proposals.values() for each in found.values() if each.proposed and each.quantity != UNKNOWN
    ]  # fmt: skip
    return {each for each in all_of_them if all_of_them.count(each) > 1}


def _together(log: Log) -> frozenset[str]:
    """Return the streams that most takes have: a channel of another would cost those takes."""
    return Counter(frozenset(take.streams) for take in log.takes).most_common(1)[0][0]


def _longest_gaps(log: Log, choices: Mapping[str, ClockChoice]) -> str:
    """Return the longest pauses in the streams that have some, in words."""
    found = []
    for name, streams in log.streams.items():
        said = max(
            (each for one in streams if (each := stream_timing(one, choices[name]))),
            key=lambda each: each.longest_gap,
            default=None,
        )
        if said is not None and said.gaps:
            found.append((said.longest_gap, f"{_comment(name)} pauses for up to {said.longest_gap:.3g} s"))
    return "; " + ", ".join(words for _, words in sorted(found, reverse=True)[:3]) if found else ""


def _events(streams: Mapping[str, list[Stream]]) -> str:
    """Return the streams that hold no numbers, in words."""
    found = [_comment(name) for name, each in streams.items() if all(field.labels for field in each[0].fields.values())]
    return f", perhaps {', '.join(found[:3])}" if found else ""


def _marks(streams: Mapping[str, list[Stream]]) -> str:
    """Return the fields that look like marks of trials, in words."""
    found = [
        f"{_comment(name)} / {_comment(field)}" for name, of_takes in streams.items() for field in of_takes[0].fields
        if re.search(r"trial|episode|run|lap|segment_?id|phase|label|mark|event|experiment", field, re.IGNORECASE)
    ]  # fmt: skip
    return f", perhaps {', '.join(found[:3])}" if found else ""


def _inline(entry: Mapping[str, object]) -> str:
    return "{ " + ", ".join(f"{key} = {toml_value(value)}" for key, value in entry.items()) + " }"


def _comment(text: str) -> str:
    """Return text that cannot end a comment or control a terminal."""
    return "".join(letter if letter.isprintable() else "\N{REPLACEMENT CHARACTER}" for letter in text)
