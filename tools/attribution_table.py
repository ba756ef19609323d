"""The table of the attribution benchmark: shares of sets, by amplitude and by how far the robot is from its description."""

from __future__ import annotations

import numpy as np

from tools.compared import KNOWN

CLASSES = ({"base_tilt", "camera_misalignment"}, {"time_delay", "actuator_lag"})  # effects such data hardly tell apart
SURE = 0.9  # a claim at this probability or more must be right nine times of ten
CLOSE = 0.15  # relative error of an effect's parameters
FLAGS = ("unexplained", "partly_explained")


def same(a: str, b: str) -> bool:
    return a == b or any(a in c and b in c for c in CLASSES)


def right(r: dict, claim: str) -> bool:
    return any(same(claim, t) for t in r["true"])


def exact(r: dict) -> bool:
    return len(r["claims"]) == len(r["true"]) and all(right(r, c) for c in r["claims"])


def first(r: dict) -> bool:
    return bool(r["claims"]) and right(r, r["claims"][0])


def false_positive(r: dict) -> bool:
    return bool(r["claims"]) or r["verdict"] in FLAGS


def flagged(r: dict) -> bool:
    return r["verdict"] in FLAGS


def share(hits: list[bool]) -> str:
    return f"{sum(hits)}/{len(hits)}" + (f" {100 * sum(hits) / len(hits):.0f} %" if hits else "")


def made(r: dict) -> bool:
    """Whether every effect of the set reached at least half of the amplitude asked for; some cannot on some designs."""
    return all(s >= 0.5 * r["amplitude"] for s in r["sigmas"])


def held(r: dict) -> list[bool]:
    """Of each claimed parameter that bench and twin share, whether its 90 % interval, 1.645 standard errors either way, holds."""
    out = []
    for t in r.get("truth", []):
        found = r.get("parameters", {}).get(t["id"], {})
        known = KNOWN[t["id"]](t["parameters"]) if t["id"] in KNOWN else {}
        told = {n: (value, *found[n]) for n, value in known.items() if n in found and found[n][1]}
        out += [abs(x - value) < 1.645 * std for value, x, std in told.values()]
    return out


def table(every: list[dict]) -> str:
    rows = [r for r in every if made(r)]
    of = {k: [r for r in rows if r["kind"] == k] for k in ("none", "one", "pair", "unknown")}
    known = [r for r in rows if r["kind"] in ("one", "pair")]
    sure = [right(r, c) for r in rows for c, p in zip(r["claims"], r["probability"], strict=True) if p >= SURE]
    answered = [r for r in rows if "after" in r]
    ratio = [r["after"] / r["floor"] for r in answered if r["kind"] in ("one", "pair")]
    seconds = [r["seconds"] for r in answered]
    wrong_names = [bool(r["claims"]) and r["verdict"] == "explained" and not all(right(r, c) for c in r["claims"]) for r in rows]
    lines = [
        f"sets                                        {len(rows)}: "
        + ", ".join(f"{len(v)} {k}" for k, v in of.items())
        + (f" ({len(every) - len(rows)} not scored: an effect that does not show on its design)" if len(every) > len(rows) else ""),
        f"no answer                                   {share(['after' not in r for r in rows])}",
        f"false positives, no effect                  {share([false_positive(r) for r in of['none']])}",
        f"right effect first, one effect              {share([first(r) for r in of['one']])}",
        f"exact set, one effect                       {share([exact(r) for r in of['one']])}",
        f"first is a true one, two effects            {share([first(r) for r in of['pair']])}",
        f"exact set, two effects                      {share([exact(r) for r in of['pair']])}",
        f"out of catalogue, flagged                   {share([flagged(r) for r in of['unknown']])}",
        f"a wrong name without a flag, all sets       {share(wrong_names)}",
        f"false 'unexplained', one or two effects     {share([r['verdict'] == 'unexplained' for r in known])}",
        f"false 'partly explained'                    {share([r['verdict'] == 'partly_explained' for r in known])}",
        f"claims at probability >= {SURE}, right         {share(sure)}",
        f"worse than calibrated on sealed trials      {share([r['after'] > 1.001 * r['calibrated'] for r in answered])}",
    ]
    apart = [x <= CLOSE for r in rows for x in r.get("apart", {}).values()]
    lines.append(f"parameters within {100 * CLOSE:.0f} %, same law            {share(apart)}")
    lines.append(f"90 % intervals that hold the truth          {share([x for r in rows for x in held(r)])}")
    if ratio:
        lines.append(
            f"sealed after / floor                        median {np.median(ratio):.3f}, 90 % {np.quantile(ratio, 0.9):.3f}"
        )
    lines.append(
        f"seconds a diagnosis, one core               median {np.median(seconds):.1f}, 90 % {np.quantile(seconds, 0.9):.1f}"
    )
    lines += ["", f"{'':30}{'no effect: false':>18}{'one: first':>14}{'one: exact':>14}{'pair: exact':>14}{'unknown: flag':>16}"]
    for key in ("amplitude", "mismatch", "design"):
        for level in sorted({r[key] for r in rows}):
            cell = {k: [r for r in v if r[key] == level] for k, v in of.items()}
            shares = [
                share([false_positive(r) for r in cell["none"]]), share([first(r) for r in cell["one"]]),
                share([exact(r) for r in cell["one"]]), share([exact(r) for r in cell["pair"]]),
                share([flagged(r) for r in cell["unknown"]]),
            ]  # fmt: skip
            name = f"{key} {level:g} sigma" if key == "amplitude" else f"{key} {level}"
            lines.append(f"{name:30}{shares[0]:>18}{shares[1]:>14}{shares[2]:>14}{shares[3]:>14}{shares[4]:>16}")
    lines += ["", "every set that went wrong:"]
    for r in sorted(rows, key=lambda r: r["seed"]):
        wrong = not flagged(r) if r["kind"] == "unknown" else not exact(r) or flagged(r)
        if wrong:
            said = f"{r['verdict']} {' + '.join(r['claims']) or '-'}" + (
                f" (too small: {', '.join(r['small'])})" if r["small"] else ""
            )
            true = " + ".join(f"{t} {s:.1f}" for t, s in zip(r["true"], r["sigmas"], strict=True)) or "none"
            lines.append(f"  {r['seed']} {r['design']}, {r['mismatch']}: {true} sigma -> {said}")
    return "\n".join(lines)
