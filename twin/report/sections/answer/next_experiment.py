"""The trial that would best decide between the explanations."""

from twin.report.contents import describe_experiment
from twin.report.sections.section import Section, Story


def section(story: Story) -> Section:
    """Return the section on the next experiment."""
    e = story.diagnosis.experiment
    content = {
        "words": describe_experiment(story.diagnosis),
        "separation": "" if e is None else f"{e.separation:.0f}",
        "repeats": 0 if e is None else e.repeats,
    }
    return Section("next", "Next experiment", "answer/next_experiment.html", content)
