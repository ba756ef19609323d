"""What is in a log, as rows of text for the terminal."""

from twin.measurements.logs.clocks import MAX_RATE, choose_clock, share_one_clock
from twin.measurements.logs.guess import guess_fields
from twin.measurements.logs.map.map_text import describe_range, stream_timing
from twin.measurements.logs.streams import Log


def stream_rows(log: Log) -> list[tuple[str, ...]]:
    """Return a row a stream: name, type, rows, rate, length, longest step, clock. Of several takes, those of the first."""
    streams = log.streams
    one_clock = share_one_clock([found[0] for found in streams.values()])
    rows = []
    for name, found in streams.items():
        stream, choice = found[0], choose_clock(found[0], one_clock)
        said = stream_timing(stream, choice)
        cells = ("?", "?", "?") if said is None else (f"{said.rate:.4g}", f"{said.span:.4g}", f"{said.longest_gap:.3g}")
        cells = ("-", "-", "-") if said is not None and said.rate != said.rate else cells
        odd = "" if said is None else f"{said.equal} equal stamps" * bool(said.equal) + f" {said.back} backward" * bool(said.back)
        odd += " is the unit right?" if said is not None and said.rate > MAX_RATE else ""
        clock = f"{choice.name} [{choice.unit or 'give the rate'}] {odd}".strip()
        count = str(stream.count) + (f" (first of {len(found)} takes)" if len(found) > 1 else "")
        rows.append((name, stream.kind, count, *cells, clock))
    return rows


def field_rows(log: Log) -> dict[str, list[tuple[str, ...]]]:
    """Return for each stream a row a field: name, range, proposed quantity, role, unit."""
    found: dict[str, list[tuple[str, ...]]] = {}
    for name, streams in log.streams.items():
        stream, proposals = streams[0], guess_fields(streams[0])
        rows = found[name] = []
        for field, each in stream.fields.items():
            if field in stream.clocks:
                rows.append((field, describe_range(each), "(a clock)", "", each.unit))
            elif each.labels:
                rows.append((field, f"texts: {', '.join(each.labels[:4])}", "(can mark trials)", "", ""))
            else:
                guess = proposals[field]
                rows.append((field, describe_range(each), guess.quantity, guess.role, guess.unit))
    return found
