"""Sensing: from what the robot feels to its shape, one estimator per file.

tensions.py   load cells, and tendon displacements where they are known, to markers with an error bar
"""

from twin.shape.tensions import Estimate, TensionShape

__all__ = ["Estimate", "TensionShape"]
