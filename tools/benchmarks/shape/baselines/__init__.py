"""Baselines that the estimators of `twin.shape` are compared with: one a module, weights in `weights/`.

Importing this package adds them to `twin.shape.estimators.estimator.estimators()`.

pointwise.py           their base: a network that gives every point's displacement
folding.py             KineSoft's decoder after FoldingNet
deepsoro.py            a decoder after DeepSoRo, trained by chamfer distance
constant_curvature.py  an arc, nothing to train
"""

from twin.shape.estimators.estimator import register_package

register_package(__name__)
