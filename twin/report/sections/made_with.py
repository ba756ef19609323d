"""How this report was made: data, command, settings, versions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from twin.report.sections.section import Section, Story
from twin.report.sentence import labels


def section(story: Story) -> Section:
    d = story.diagnosis
    r = d.bench.recording
    facts = [
        ("recording", r.title),
        ("source of the data", r.source),
        ("folder", str(r.folder) if r.folder else "in memory"),
        ("samples", f"{d.bench.n_sample} in {len(d.bench.inputs)} trials, {len(d.bench.outputs)} output channels"),
        ("trials fitted", ", ".join(labels(d, d.fitted_trials))),
        ("trials sealed", ", ".join(labels(d, d.sealed_trials))),
        ("robot", f"{d.bench.robot.name}: {d.bench.robot.title}"),
        *_flat(story.provenance),
    ]
    return Section("made", "How this was made", "made_with.html", {"facts": facts})


def _flat(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    for name, value in table.items():
        words = f"{prefix}{name.replace('_', ' ')}"
        if isinstance(value, Mapping):
            yield from _flat(value, f"{words}: ")
        else:
            yield words, str(value)
