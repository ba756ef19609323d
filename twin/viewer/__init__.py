"""Show a robot in a browser: under sliders, or replaying a measurement set beside the prediction.

app.py         the panel of twins                    trials.py      the panel of recorded task trials
panel.py       what panels share, and their loop     address.py     host and port, checked before serving
controls.py    sliders of a robot by hand            live.py        the robot under these sliders
replay.py      trials of a set, predicted            scrubber.py    clock and error plots of a replay
shown_twin.py  one of the twins shown                waiting.py     says in the page what takes long
drawing/       scene, solids, colours, plots, pictures and films
"""

from twin.viewer.app import TwinPanel
from twin.viewer.drawing.headless import take_film
from twin.viewer.panel import serve
from twin.viewer.trials import TaskPanel

__all__ = ["TaskPanel", "TwinPanel", "serve", "take_film"]
