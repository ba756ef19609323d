"""The report in a terminal."""

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from twin.diagnosis import DataPreview, Diagnosis
from twin.foundation.display_names import display_name
from twin.prediction.evaluate import OUTPUT_GROUPS
from twin.report.contents import describe_experiment
from twin.report.hand_check import all_notices, hand_check
from twin.report.numbers import DISPLAY_UNITS, format_with_error
from twin.report.plots.loops import describe_loops
from twin.report.sections.answer.before_after import error_rows
from twin.report.sections.answer.effects import effect_rows
from twin.report.sections.data import under_hand
from twin.report.sentence import describe_undetectable, headline_group, output_groups, sentence


def render_diagnosis(diagnosis: Diagnosis) -> RenderableType:
    """Return the sentence, the error before and after, the effects and the next experiment."""
    d = diagnosis
    parts: list[RenderableType] = []
    if d.suspicions:
        count = f"{len(d.suspicions)} possible mistake{'s' if len(d.suspicions) > 1 else ''}"
        parts += [Text(f"{count} in the files, listed above: check before you rely on this result.", "yellow")]
    parts += [Text(sentence(d), style="bold"), Text("")]
    for group in output_groups(d):
        title = f"{display_name(OUTPUT_GROUPS[group].kind)} error on held-out trials ({d.prepared.recording.source})"
        error = _table()
        for name, justify in (("", "left"), (f"RMS, {DISPLAY_UNITS[group][0]}", "right"), ("95 % confidence", "right")):
            error.add_column(name, justify=justify)  # type: ignore[arg-type]
        for row in error_rows(d, group):
            error.add_row(row["stage"], row["error"], row["interval"])
        parts += [Text(title, style="dim"), error, Text("")]
    if d.claims:
        effects = _table()
        for name, justify in (
            ("", "left"),
            ("parameters", "left"),
            ("probability", "right"),
            (f"error without, {DISPLAY_UNITS[headline_group(d)][0]}", "right"),
        ):
            effects.add_column(name, justify=justify)  # type: ignore[arg-type]
        for claim, row in zip(d.claims, effect_rows(d.claims, headline_group(d)), strict=True):
            values = "\n".join(f"{n} = {format_with_error(f)}" for n, f in claim.parameters.items())
            effects.add_row(str(row["name"]), Text(values), str(row["probability"]), str(row["error"]))
        parts += [Text("effects in the twin", style="dim"), effects, Text("")]
    parts += [Text(describe_loops(d.loops)), Text("")]
    if (check := hand_check(d)) is not None:
        parts += [Text(under_hand.describe_hand_check(check)), Text("")]
    if d.verdict in ("partly_explained", "unexplained"):
        parts.append(Text(d.description))
    if (words := describe_experiment(d)) is not None:
        parts.append(Text.assemble(("Next experiment: ", "bold"), words))
    if (words := describe_undetectable(d)) is not None:
        parts.append(Text(words))
    if notices := all_notices(d):
        count = f"{len(notices)} notice{'s' if len(notices) > 1 else ''}"
        parts.append(Text(f"{count} about the data in the report.", style="dim"))
    return Group(*parts)


def render_preview(preview: DataPreview) -> RenderableType:
    """Return what was found before any fit: possible mistakes in the files, each with a correction, and loops."""
    lines: list[Text] = []
    if preview.suspicions:
        lines = [Text("Possible mistakes in the files (nothing is changed):", style="yellow")]
        for s in preview.suspicions:
            lines.append(Text.assemble((f"{s.kind}: ", "bold"), f"{s.words}.\n  Possible correction: {s.change}."))
    return Group(*lines, Text.assemble(("Before any fit: ", "bold"), describe_loops(preview.loops)), Text(""))


def _table() -> Table:
    return Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
