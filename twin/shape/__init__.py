"""Sensing: from what the robot feels to its shape.

tensions.py    load cells, and tendon displacements where they are known, to markers with an error bar

Strain sensors to the surface of a soft finger, one estimator per file, found by themselves:

physics.py     the twin's equilibrium under the likeliest push         estimator.py  what an estimator is
modal.py       a small network onto the twin's deformation modes       learned.py    what one with weights is; weights.py
folding.py     KineSoft's decoder, a baseline                          training.py   how those are trained (torch): lesson.py what
deepsoro.py    a decoder trained by chamfer distance, a baseline                     differs between them, judge.py their bands
constant_curvature.py  an arc, a baseline

free.py        strains that tendons alone make                         drift.py      what sensors drifted by, from free motion
sensing.py     a trial to strains and displacements                    align.py      R0, kappa and mounting angle from clouds
band.py        how wide a band is to be, from clouds
predict.py     a recording's shapes as a file                          cloud_fit.py, sensor_fit.py, skin.py  what it is made of
"""

from twin.shape.tensions import Estimate, TensionShape

__all__ = ["Estimate", "TensionShape"]
