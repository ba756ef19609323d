"""`twin effects`: list the effects of the catalogue."""

import sys
from dataclasses import dataclass

from rich.table import Table

from twin.cli.terminal import out


@dataclass(frozen=True)
class Effects:
    """List the effects that a diagnosis can find."""

    def run(self) -> None:
        from twin.effects import catalogue

        table = Table("effect", "what it is", "parameters", "varies with")
        for name, effect in catalogue().items():
            first = (sys.modules[effect.__module__].__doc__ or "").strip().splitlines()[0]
            names = [*(p.name for p in effect.parameters), *(f"{p.name}_i" for p in effect.per_tendon)]
            table.add_row(name, first.partition(": ")[2].rstrip("."), ", ".join(names), effect.moves_with)
        out.print(table)
