"""Imitation: demonstrations by a person's hand, policies learned from them, and trials by tendons.

demonstrate.py      tasks shown by a person's hand
lerobot.py          the layout of their files
hand_model.py       built hands, and the shape of all fingers
representations.py  observation and control by shape, strain or bend
policy.py           networks: diffusion, cloning
policy_training.py  their training
imitate.py          policies run on fresh trials
sensor_drift.py     sensors that drift over a day of trials
episode_store.py    trials stored for viewing
"""
