"""Baselines that the estimators of `twin.shape` are compared with: one a module, weights in `weights/`.

Importing this package adds them to `twin.shape.estimators.estimator.estimators()`.

folding.py             KineSoft's decoder after FoldingNet
constant_curvature.py  an arc, nothing to train
"""

from twin.shape.estimators.estimator import register_package

register_package(__name__)
