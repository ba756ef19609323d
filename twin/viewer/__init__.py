"""The robot in a browser: as it stands under sliders, or as it moved in a measurement set, beside what was measured.

figures.py   a robot's shapes as arrays: links, tendons, skin, markers      live.py    the robot under sliders
colours.py   values as colours, and the bar that says which                 replay.py  a set's trials, predicted by two twins
scene.py     those arrays as viser draws them                               app.py     the panel, and the loop that serves it
"""

from twin.viewer.app import App, serve

__all__ = ["App", "serve"]
