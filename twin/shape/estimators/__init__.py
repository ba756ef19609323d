"""Estimators of a soft finger's shape: one a module, found by its file's name.

estimator.py      the base class, its input and its output      learned.py           base of estimators with weights modal.py
a network onto deformation modes              deformation_modes.py the modes and their coupling physics.py        the twin's
equilibrium under a push           tendon_strains.py    strains that tendons alone make features.py       inputs of networks
weights.py           weights on disk, perceptrons tension_shape.py  markers of a rod from load cells, a filter of its own
"""
