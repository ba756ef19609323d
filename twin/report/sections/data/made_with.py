"""The origin of the report: data, command, settings, versions."""

from collections.abc import Iterator, Mapping
from typing import Any

from twin.foundation.display_names import display_name
from twin.report.sections.section import Section, Story
from twin.report.sentence import trial_labels


def section(story: Story) -> Section:
    """Return the section on how the report was made."""
    d = story.diagnosis
    r = d.prepared.recording
    facts = [
        ("recording", r.title),
        ("source of the data", r.source),
        ("folder", str(r.folder) if r.folder else "in memory"),
        ("samples", f"{d.prepared.n_sample} in {len(d.prepared.inputs)} trials, {len(d.prepared.outputs)} output channels"),
        ("fitted trials", ", ".join(trial_labels(d, d.fitted_trials))),
        ("held-out trials", ", ".join(trial_labels(d, d.held_out_trials))),
        ("robot", f"{d.prepared.robot.name}: {d.prepared.robot.title}"),
        *_flattened(story.provenance),
    ]
    return Section("made", "How this report was made", "data/made_with.html", {"facts": facts})


def _flattened(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    for name, value in table.items():
        words = f"{prefix}{display_name(name)}"
        if isinstance(value, Mapping):
            yield from _flattened(value, f"{words}: ")
        else:
            yield words, str(value)
