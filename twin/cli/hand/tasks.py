"""`twin tasks`: list the tasks of a hand."""

from dataclasses import dataclass

from rich.table import Table

from twin.cli.terminal import out


@dataclass(frozen=True)
class Tasks:
    """List the tasks of a hand and their criteria of success."""

    def run(self) -> None:
        from twin.tasks import tasks

        table = Table("task", "what it is", "success", "duration, s")
        for name, task in tasks().items():
            table.add_row(name, task.description, task.success_criterion, f"{task.duration:g}")
        out.print(table)
