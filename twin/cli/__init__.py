"""The command line, one command in each file.

Exit codes: 0 done; 1 stopped (Ctrl-C) or a fault of the program; 2 bad input, reported in one line.
"""

import os
import sys
from typing import NoReturn

import tyro

from twin.cli.data.calibrate import Calibrate
from twin.cli.data.diagnose import Diagnose
from twin.cli.data.evaluate import Evaluate
from twin.cli.data.export import Export
from twin.cli.data.simulate import Simulate
from twin.cli.finger.align import Align
from twin.cli.finger.generate import Generate
from twin.cli.finger.shape import Shape
from twin.cli.finger.train import Train
from twin.cli.hand.demonstrate import Demonstrate
from twin.cli.hand.imitate import Imitate
from twin.cli.hand.tasks import Tasks
from twin.cli.library_messages import route_library_messages
from twin.cli.robot.effects import Effects
from twin.cli.robot.new import New
from twin.cli.robot.robots import Robots
from twin.cli.terminal import accept_any_encoding, err
from twin.cli.use.rollout import Rollout
from twin.cli.use.view import View
from twin.foundation.errors import TwinError

PROGRAM_SUMMARY = "A digital twin of tendon-driven soft and continuum robots that learns from measured data what it is missing."
Command = (
    New | Robots | Diagnose | Evaluate | Simulate | Rollout | View | Calibrate | Effects | Generate | Train | Align | Shape | Tasks
    | Demonstrate | Imitate | Export
)  # fmt: skip


def main() -> None:
    """Run the `twin` command."""
    accept_any_encoding()
    route_library_messages()
    command: Command = tyro.cli(Command, prog="twin", description=PROGRAM_SUMMARY)  # type: ignore[arg-type]
    try:
        command.run()
    except TwinError as error:
        err.print(f"twin: {error}", style="red", markup=False, highlight=False, soft_wrap=True)
        _leave(2)
    except KeyboardInterrupt:
        err.print("twin: stopped; nothing half-written is left")
        _leave(1)


def _leave(code: int) -> NoReturn:
    """End the program at once: worker threads may be inside compiled code and would crash a normal shutdown."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
