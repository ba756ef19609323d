"""Estimators of a soft finger's shape: one a module, found by its file's name.

estimator.py          the base class, its input and its output
physics.py            the twin's equilibrium under a push
modal.py              a network onto deformation modes
learned.py            base of estimators with weights
deformation_modes.py  the modes and their coupling
tendon_strains.py     strains that tendons alone make
features.py           inputs of networks
weights.py            weights on disk, perceptrons
tension_shape.py      markers of a rod from load cells, a filter of its own
"""
