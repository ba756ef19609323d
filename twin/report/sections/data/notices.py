"""Notices about the data in plain words."""

from twin.report.hand_check import all_notices
from twin.report.sections.section import Section, Story


def section(story: Story) -> Section:
    """Return the section with the notices."""
    return Section(
        "notices", "Notices about the data", "data/notices.html", {"notices": list(dict.fromkeys(all_notices(story.diagnosis)))}
    )
