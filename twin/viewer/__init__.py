"""The robot in a browser: as it stands under sliders, or as it moved in a measurement set, beside what was measured.

live.py     the robot under sliders                         colours.py  values as colours, and the bar that says which
replay.py   a set's trials, predicted by two twins          scene.py    a figure's frames (twin/figure.py) as viser draws them
app.py      the panel, and the loop that serves it
"""

from twin.viewer.app import App, serve

__all__ = ["App", "serve"]
