"""Public logs of robots that have an MJCF: written as measurement sets, diagnosed, judged on rows that no fit has seen.

xl330.py      a servo with a pendulum      go2_legs.py   the legs of a quadruped     aero_hand.py   a tendon-driven hand
"""
