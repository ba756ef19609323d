"""Reports of a diagnosis, for people and for programs.

write.py        writes report.json, report.html and twin.toml, all or none
contents.py     report.json, a contract with other programs
sentence.py     the verdict in one plain sentence
page.py         report.html, one self-contained file made of sections/ and templates/
console.py      the report in a terminal
robot_page.py   a picture of a robot
hand_check.py   sensors compared with measured shapes under a hand
provenance.py   versions, seed, data hash, command, date
numbers.py      values with units and errors
plots/          the figures and the predictions they compare
"""

from twin.report.console import render_diagnosis, render_preview
from twin.report.contents import contents
from twin.report.provenance import provenance
from twin.report.sentence import sentence
from twin.report.write import write

__all__ = ["contents", "provenance", "render_diagnosis", "render_preview", "sentence", "write"]
