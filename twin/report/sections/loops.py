"""Loops: each trial's, as a table."""

from __future__ import annotations

from twin.report import strains, widths
from twin.report.loops import loop_words
from twin.report.numbers import SHOWN, number
from twin.report.sections.section import Section, Story
from twin.report.sentence import labels


def section(story: Story) -> Section:
    d = story.diagnosis
    unit, factor = SHOWN[d.loops.group]
    names = labels(d, tuple(loop.trial for loop in d.loops.each))
    rows = [
        {
            "trial": name,
            "lag": number(factor * loop.lag),
            "noise": number(factor * loop.noise),
            "drift": number(None if loop.drift is None else factor * loop.drift),
            "pairs": loop.pairs,
            "seen": loop.seen,
        }
        for name, loop in zip(names, d.loops.each, strict=True)
    ]
    plots = {"widths": widths.plot(d), "strains": strains.plot(d)}
    return Section("loops", "Loops", "loops.html", {"rows": rows, "unit": unit, "words": loop_words(d.loops), **plots})
