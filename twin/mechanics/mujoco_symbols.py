"""MuJoCo's kinematics and step functions, callable by symbol from compiled code.

They are bound by name, not by address. Numba's disk cache of the functions that call them then stays valid in the next process.

MuJoCo's own words about motion that is lost, and its log file in the working folder, are kept back, unless somebody listens to them
already: the twin says what was lost in errors of its own.
"""

from pathlib import Path

import llvmlite.binding as llvm
import mujoco
from numba.core import types

MUJOCO_LIBRARY = next(Path(mujoco.__file__).parent.glob("libmujoco*.so*"), None) or next(
    Path(mujoco.__file__).parent.glob("*mujoco*.d*l*")
)
llvm.load_library_permanently(str(MUJOCO_LIBRARY))


def _unheard(words: str) -> None:
    """Ignore a warning of MuJoCo."""


if mujoco.get_mju_user_warning() is None:
    mujoco.set_mju_user_warning(_unheard)

_MODEL_DATA = types.void(types.uintp, types.uintp)
mj_kinematics = types.ExternalFunction("mj_kinematics", _MODEL_DATA)
mj_com_pos = types.ExternalFunction("mj_comPos", _MODEL_DATA)
mj_step = types.ExternalFunction("mj_step", _MODEL_DATA)
mj_step1 = types.ExternalFunction("mj_step1", _MODEL_DATA)
mj_step2 = types.ExternalFunction("mj_step2", _MODEL_DATA)
mj_full_m = types.ExternalFunction("mj_fullM", types.void(types.uintp, types.uintp, types.CPointer(types.float64)))
mj_fwd_actuation = types.ExternalFunction("mj_fwdActuation", _MODEL_DATA)
