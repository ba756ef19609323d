"""The robot in a browser: as it stands under sliders, or as it moved in a measurement set, beside what was measured.

live.py     the robot under sliders, and under currents     controls.py  those sliders
replay.py   a set's trials, predicted                       scrubber.py  their clock and their errors
side.py     one of the twins that are shown                 colours.py   values as colours, and the bar that says which
stage.py    a task's trials, as they were                   solids.py    the things in them
film.py     pictures and films of the scene                 scene.py     a figure's frames (twin/figure.py) as viser draws them
app.py      the panel of twins                              trials.py    the panel of tasks
panel.py    what panels share, and the loop that serves     headless.py  a film without a window
"""

from twin.viewer.app import App
from twin.viewer.headless import take_film
from twin.viewer.panel import serve
from twin.viewer.trials import Trials

__all__ = ["App", "Trials", "serve", "take_film"]
