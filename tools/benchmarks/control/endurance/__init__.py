"""Hours of control by shape on a finger the controller does not know.

course.py   what is wanted, what pushes and how sensors drift, minute by minute, by the seed alone
rig.py      the finger, its controller, and what is looked at in every step
log.py      what is kept of it: a line a minute, and the state to go on from
"""
