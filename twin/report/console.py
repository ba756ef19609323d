"""The verdict in a terminal."""

from __future__ import annotations

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from twin.diagnose import Diagnosis, Looked
from twin.evaluate import KIND
from twin.report.contents import experiment_words
from twin.report.loops import loop_words
from twin.report.numbers import SHOWN, plus_minus
from twin.report.sections import under_hand
from twin.report.sections.before_after import rows
from twin.report.sections.effects import table
from twin.report.sentence import blind, groups, headline, sentence


def console(diagnosis: Diagnosis) -> RenderableType:
    """The sentence, the error before and after, the effects, and the next experiment."""
    d = diagnosis
    parts: list[RenderableType] = []
    if d.suspicions:
        count = f"{len(d.suspicions)} suspicion{'s' if len(d.suspicions) > 1 else ''}"
        parts += [Text(f"{count} about what the files mean, told before the fit: settle them before you believe this.", "yellow")]
    parts += [Text(sentence(d), style="bold"), Text("")]
    for group in groups(d):
        title = f"{KIND[group].replace('_', ' ')} error on sealed trials ({d.bench.recording.source})"
        error = _table()
        for name, justify in (("", "left"), (f"RMS, {SHOWN[group][0]}", "right"), ("95 % confidence", "right")):
            error.add_column(name, justify=justify)  # type: ignore[arg-type]
        for row in rows(d, group):
            error.add_row(row["stage"], row["error"], row["interval"])
        parts += [Text(title, style="dim"), error, Text("")]
    if d.claims:
        effects = _table()
        for name, justify in (
            ("", "left"),
            ("parameters", "left"),
            ("probability", "right"),
            (f"error without, {SHOWN[headline(d)][0]}", "right"),
        ):
            effects.add_column(name, justify=justify)  # type: ignore[arg-type]
        for claim, row in zip(d.claims, table(d.claims, headline(d)), strict=True):
            values = "\n".join(f"{n} = {plus_minus(f)}" for n, f in claim.parameters.items())
            effects.add_row(str(row["name"]), Text(values), str(row["probability"]), str(row["error"]))
        parts += [Text("effects in force", style="dim"), effects, Text("")]
    parts += [Text(loop_words(d.loops)), Text("")]
    if d.under_hand is not None:
        parts += [Text(under_hand.words(d.under_hand)), Text("")]
    if d.verdict in ("partly_explained", "unexplained"):
        parts.append(Text(d.description))
    if (words := experiment_words(d)) is not None:
        parts.append(Text.assemble(("Next experiment: ", "bold"), words))
    if (words := blind(d)) is not None:
        parts.append(Text(words))
    if d.notices:
        count = f"{len(d.notices)} notice{'s' if len(d.notices) > 1 else ''}"
        parts.append(Text(f"{count} about the data in the report.", style="dim"))
    return Group(*parts)


def beforehand(looked: Looked) -> RenderableType:
    """What was seen before any fit: what the files may mean otherwise, each with the change that would remove it, and loops."""
    said: list[Text] = []
    if looked.suspicions:
        said = [Text("What the files may mean otherwise (nothing is repaired):", style="yellow")]
        for s in looked.suspicions:
            said.append(Text.assemble((f"{s.kind}: ", "bold"), f"{s.words}.\n  Change that would remove it: {s.change}."))
    return Group(*said, Text.assemble(("Before any fit: ", "bold"), loop_words(looked.loops)), Text(""))


def _table() -> Table:
    return Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
