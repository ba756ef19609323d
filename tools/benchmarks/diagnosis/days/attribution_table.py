"""The table of the attribution benchmark: shares of sets, by amplitude and by how far the robot is from its description."""

import numpy as np

from tools.benchmarks.diagnosis.answer import in_words
from tools.benchmarks.diagnosis.compared import COMPARABLE
from tools.benchmarks.table import share

CLASSES = ({"base_tilt", "camera_misalignment"}, {"time_delay", "actuator_lag"})  # effects such data hardly tell apart
SURE_PROBABILITY = 0.9  # a claim at this probability or more must be right nine times of ten
PARAMETER_ERROR = 0.15  # relative error of an effect's parameters
FLAGS = ("unexplained", "partly_explained")


def same(a: str, b: str) -> bool:
    """Return whether two effects count as one."""
    return a == b or any(a in c and b in c for c in CLASSES)


def right(r: dict, claim: str) -> bool:
    """Return whether a claim is one of the true effects."""
    return any(same(claim, t) for t in r["true"])


def exact(r: dict) -> bool:
    """Return whether all true effects are claimed and no other."""
    return len(r["claims"]) == len(r["true"]) and all(right(r, c) for c in r["claims"])


def first(r: dict) -> bool:
    """Return whether the first claim is a true effect."""
    return bool(r["claims"]) and right(r, r["claims"][0])


def false_positive(r: dict) -> bool:
    """Return whether a set without an effect is said to have one."""
    return bool(r["claims"]) or r["verdict"] in FLAGS


def flagged(r: dict) -> bool:
    """Return whether the verdict says that something unknown is left."""
    return r["verdict"] in FLAGS


def made(r: dict) -> bool:
    """Return whether every effect of the set reached at least half of the amplitude asked for; some cannot on some designs."""
    return all(s >= 0.5 * r["amplitude"] for s in r["sigmas"])


def held(r: dict) -> list[bool]:
    """Return, of each claimed parameter that has one law in simulator and twin, whether its 90 % interval holds the truth."""
    out = []
    for t in r.get("truth", []):
        found = r.get("parameters", {}).get(t["id"], {})
        known = COMPARABLE[t["id"]](t["parameters"]) if t["id"] in COMPARABLE else {}
        told = {n: (value, *found[n]) for n, value in known.items() if n in found and found[n][1]}
        out += [abs(x - value) < 1.645 * std for value, x, std in told.values()]
    return out


def table(every: list[dict]) -> str:
    """Return the table of all sets, and a line for each that went wrong."""
    rows = [r for r in every if made(r)]
    not_scored = f" ({len(every) - len(rows)} not scored: an effect that does not show on its design)"
    counts = ", ".join(f"{len(v)} {k}" for k, v in _by_kind(rows).items())
    totals = {"sets": f"{len(rows)}: {counts}{not_scored if len(every) > len(rows) else ''}", **_totals(rows)}
    lines = [f"{label:44}{value}" for label, value in totals.items()]
    return "\n".join([*lines, "", *_levels(rows), "", "every set that went wrong:", *_wrong(rows)])


def _by_kind(rows: list[dict]) -> dict[str, list[dict]]:
    return {kind: [r for r in rows if r["kind"] == kind] for kind in ("none", "one", "pair", "unknown")}


def _totals(rows: list[dict]) -> dict[str, str]:
    of, answered = _by_kind(rows), [r for r in rows if "after" in r]
    known = [r for r in rows if r["kind"] in ("one", "pair")]
    sure = [right(r, c) for r in rows for c, p in zip(r["claims"], r["probability"], strict=True) if p >= SURE_PROBABILITY]
    ratio = [r["after"] / r["floor"] for r in answered if r["kind"] in ("one", "pair")]
    seconds = [r["seconds"] for r in answered]
    wrong_names = [bool(r["claims"]) and r["verdict"] == "explained" and not all(right(r, c) for c in r["claims"]) for r in rows]
    found = {
        "no answer": share(["after" not in r for r in rows]),
        "false positives, no effect": share([false_positive(r) for r in of["none"]]),
        "right effect first, one effect": share([first(r) for r in of["one"]]),
        "exact set, one effect": share([exact(r) for r in of["one"]]),
        "first is a true one, two effects": share([first(r) for r in of["pair"]]),
        "exact set, two effects": share([exact(r) for r in of["pair"]]),
        "out of catalogue, flagged": share([flagged(r) for r in of["unknown"]]),
        "a wrong name without a flag, all sets": share(wrong_names),
        "false 'unexplained', one or two effects": share([r["verdict"] == "unexplained" for r in known]),
        "false 'partly explained'": share([r["verdict"] == "partly_explained" for r in known]),
        f"claims at probability >= {SURE_PROBABILITY}, right": share(sure),
        "worse than calibrated on held-out trials": share([r["after"] > 1.001 * r["calibrated"] for r in answered]),
        f"parameters within {100 * PARAMETER_ERROR:.0f} %, same law": share(
            [x <= PARAMETER_ERROR for r in rows for x in r.get("apart", {}).values()]
        ),
        "90 % intervals that hold the truth": share([x for r in rows for x in held(r)]),
        "seconds a diagnosis, one core": f"median {np.median(seconds):.1f}, 90 % {np.quantile(seconds, 0.9):.1f}",
    }
    over = {"held-out after / floor": f"median {np.median(ratio):.3f}, 90 % {np.quantile(ratio, 0.9):.3f}"} if ratio else {}
    return found | over


def _levels(rows: list[dict]) -> list[str]:
    """The same shares by amplitude, mismatch and design."""
    lines = [f"{'':30}{'no effect: false':>18}{'one: first':>14}{'one: exact':>14}{'pair: exact':>14}{'unknown: flag':>16}"]
    for key in ("amplitude", "mismatch", "design"):
        for level in sorted({r[key] for r in rows}):
            of = _by_kind([r for r in rows if r[key] == level])
            name = f"{key} {level:g} sigma" if key == "amplitude" else f"{key} {level}"
            counted = (
                ("none", false_positive, 18),
                ("one", first, 14),
                ("one", exact, 14),
                ("pair", exact, 14),
                ("unknown", flagged, 16),
            )
            lines.append(f"{name:30}" + "".join(f"{share([hit(r) for r in of[kind]]):>{width}}" for kind, hit, width in counted))
    return lines


def _wrong(rows: list[dict]) -> list[str]:
    lines = []
    for r in sorted(rows, key=lambda r: r["seed"]):
        if not flagged(r) if r["kind"] == "unknown" else not exact(r) or flagged(r):
            small = f" (too small: {', '.join(r['small'])})" if r["small"] else ""
            true = " + ".join(f"{t} {s:.1f}" for t, s in zip(r["true"], r["sigmas"], strict=True)) or "none"
            lines.append(f"  {r['seed']} {r['design']}, {r['mismatch']}: {true} sigma -> {in_words(r)}{small}")
    return lines
