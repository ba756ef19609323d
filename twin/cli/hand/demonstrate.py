"""`twin demonstrate`: simulate demonstrations of a task."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from twin.cli.hand.records import HAND, count_outcomes, write_provenance
from twin.cli.terminal import cpu_count, out, show_progress
from twin.foundation.errors import DataError


@dataclass(frozen=True)
class Demonstrate:
    """Simulate demonstrations of a task: a person pushes the fingers of a hand, whose tendons are slack, and sensors record.

    Keeps the successful attempts, in the layout of LeRobot datasets, equal for any number of jobs. After a stop, run again to
    continue.
    """

    task: Positional[Annotated[str, arg(help="name of the task; an unknown name lists those available")]]
    n: Annotated[int, arg(help="number of demonstrations")]
    out: Annotated[Path, arg(help="folder for the demonstrations")]
    seed: Annotated[int, arg(help="seed of the hand and of all random draws")] = 0
    jobs: Annotated[int, arg(help="worker threads")] = cpu_count()

    def run(self) -> None:
        from twin.robots import load
        from twin.tasks import make_task
        from twin.tasks.imitation.demonstrate import DemonstrationOrder, demonstrate
        from twin.tasks.imitation.episode_store import DEMONSTRATIONS

        if self.n < 1 or self.seed < 0 or self.jobs < 1:
            raise DataError(f"--n {self.n} --seed {self.seed} --jobs {self.jobs}: n and jobs must be 1 or more, seed 0 or more")
        order = DemonstrationOrder(make_task(self.task), load(HAND), self.n, self.seed)
        out.print(f"{self.task}: success is that {order.task.success_criterion}", highlight=False, markup=False)
        with show_progress(f"showing {self.task}") as progress:
            outcomes = demonstrate(order, self.out, self.jobs, progress)
        command = f"twin demonstrate {self.task} --n {self.n} --seed {self.seed} --out {self.out}"
        write_provenance(self.out, DEMONSTRATIONS, command, self.seed)
        out.print(f"demonstrations: {self.out}; attempts: {count_outcomes(outcomes)}", highlight=False, markup=False)
        out.print(f"to see them: twin view {self.out}", highlight=False, markup=False)
