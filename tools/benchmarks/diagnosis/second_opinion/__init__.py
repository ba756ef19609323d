"""Other ways to name a missing effect, on the same measurement sets: what the diagnosis is compared with.

All start where the diagnosis starts: the same trials held out, the same noise, the same calibrated robot, the same catalogue and
the same first-order screen. Only the selection differs.
"""
