"""What every test worker needs before numpy and MuJoCo are imported."""

from __future__ import annotations

import os

os.environ.setdefault("MUJOCO_GL", "egl")  # before anything imports mujoco, which reads it then
# Two workers share two cores: with two threads each, linear algebra would wait for cores longer than it works.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")
