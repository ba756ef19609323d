"""What a reader should know about the data, in plain language."""

from __future__ import annotations

from twin.report.sections.section import Section, Story


def section(story: Story) -> Section:
    return Section("notices", "Notices about the data", "notices.html", {"notices": list(dict.fromkeys(story.diagnosis.notices))})
