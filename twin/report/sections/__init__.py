"""The sections of report.html, in order: one function `section(story)` in each file, with its template."""

from collections.abc import Callable

from twin.report.sections.answer import attribution, before_after, effects, leftover, next_experiment, residual
from twin.report.sections.data import identifiability, loops, made_with, noise, notices, parameters, shapes, tip, under_hand
from twin.report.sections.section import Section, Story

SECTIONS: tuple[Callable[[Story], Section | None], ...] = (
    before_after.section,
    effects.section,
    loops.section,
    residual.section,
    shapes.section,
    tip.section,
    leftover.section,
    attribution.section,
    next_experiment.section,
    identifiability.section,
    parameters.section,
    under_hand.section,
    noise.section,
    notices.section,
    made_with.section,
)

__all__ = ["SECTIONS", "Section", "Story"]
