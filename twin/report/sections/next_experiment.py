"""The one trial that would best settle the doubt."""

from __future__ import annotations

from twin.report.contents import experiment_words
from twin.report.sections.section import Section, Story


def section(story: Story) -> Section:
    e = story.diagnosis.experiment
    content = {
        "words": experiment_words(story.diagnosis),
        "separation": "" if e is None else f"{e.separation:.0f}",
        "repeats": 0 if e is None else e.repeats,
    }
    return Section("next", "The next experiment", "next_experiment.html", content)
