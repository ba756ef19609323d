"""MuJoCo's own kinematics, called by symbol from compiled code.

The functions are bound by name, not by address, so that numba's disk cache of everything that calls them stays valid from
one process to the next.
"""

from __future__ import annotations

from pathlib import Path

import llvmlite.binding as llvm
import mujoco
from numba.core import types

_LIBRARY = next(Path(mujoco.__file__).parent.glob("libmujoco*.so*"), None) or next(
    Path(mujoco.__file__).parent.glob("*mujoco*.d*l*")
)
llvm.load_library_permanently(str(_LIBRARY))

_MODEL_DATA = types.void(types.uintp, types.uintp)
mj_kinematics = types.ExternalFunction("mj_kinematics", _MODEL_DATA)
mj_com_pos = types.ExternalFunction("mj_comPos", _MODEL_DATA)
mj_step = types.ExternalFunction("mj_step", _MODEL_DATA)
