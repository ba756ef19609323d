"""Loops of pull and release, a row for each trial."""

from twin.report.numbers import DISPLAY_UNITS, format_number
from twin.report.plots import loop_widths, strain_loops
from twin.report.plots.loops import describe_loops
from twin.report.sections.section import Section, Story
from twin.report.sentence import trial_labels


def section(story: Story) -> Section:
    """Return the section on loops of pull and release."""
    d = story.diagnosis
    unit, factor = DISPLAY_UNITS[d.loops.group]
    names = trial_labels(d, tuple(loop.trial for loop in d.loops.by_trial))
    rows = [
        {
            "trial": name,
            "lag": format_number(factor * loop.lag),
            "noise": format_number(factor * loop.noise),
            "drift": format_number(None if loop.drift is None else factor * loop.drift),
            "pairs": loop.pairs,
            "seen": loop.seen,
        }
        for name, loop in zip(names, d.loops.by_trial, strict=True)
    ]
    plots = {"widths": loop_widths.plot(d), "strains": strain_loops.plot(d)}
    return Section("loops", "Loops", "data/loops.html", {"rows": rows, "unit": unit, "words": describe_loops(d.loops), **plots})
