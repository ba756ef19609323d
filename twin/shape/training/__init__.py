"""Training of estimators with weights (torch).

samples.py        training data, with sensor errors          held_out_evaluation.py  band and errors on held-out fingers
training_spec.py  how one network is trained                 train.py                the training loop, resumable
"""
