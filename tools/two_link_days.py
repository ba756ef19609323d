"""How often the diagnosis names what is wrong with a two-link finger, on fresh days of tools/bench/two_link.py.

    python -m tools.two_link_days OUT [FIRST_SEED]

What bends this finger is the difference of its two tensions: a load cell's gain and crosstalk from the other are one and the same
to it. Days with either are run too, after the twelve, and should end in the two being called inseparable. A load cell's bias is
left out: it bends the joints as their springs' rest angles do, which a built finger may be off by.
"""

from __future__ import annotations

import sys
from pathlib import Path

from tools.bench.two_link import write_day
from twin.diagnose import Settings, diagnose
from twin.measurements import read
from twin.robots import load
from twin.twin import Twin

DAYS = (
    None, None, "tendon_friction", "tendon_friction", "load_cell_drift", "load_cell_drift", "tip_payload", "tip_payload",
    "base_tilt", "time_delay", "actuator_saturation", "temperature_softening",
)  # fmt: skip
ALIKE = ("load_cell_gain", "load_cell_crosstalk")


def main() -> None:
    out, first = Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 21000
    right = 0
    for n, effect in enumerate((*DAYS, *ALIKE)):
        folder = out / f"{first + n}_{effect or 'none'}"
        if not folder.exists():
            write_day(folder, effect, first + n)
        found = diagnose(read(folder), Twin.of(load("two_link")), Settings(jobs=1))
        named = [claim.effect for claim in found.claims]
        rivals = sorted(found.ambiguous) == sorted((e,) for e in ALIKE)
        ok = rivals and not named if effect in ALIKE else named[:1] == ([effect] if effect else [])
        right += ok and n < len(DAYS)
        error = found.errors
        sealed = " / ".join(f"{1e3 * e['marker']:.2f}" for e in (error.calibrated, error.after, error.floor))
        said = f"{found.verdict} {' + '.join(named) or '-'} {'ok' if ok else 'WRONG'}"
        print(f"{first + n} {effect or 'none'}: {said}; sealed, calibrated / after / floor: {sealed} mm", flush=True)
    print(f"right first: {right} of {len(DAYS)}")


if __name__ == "__main__":
    main()
