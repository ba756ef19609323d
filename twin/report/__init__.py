"""What a diagnosis found, for people and for programs.

write.py        report.json, report.html and twin.toml, whole or not at all
contents.py     report.json: the contract other programs read
sentence.py     the verdict in one plain sentence
page.py         report.html: one self-contained file made of sections/*.py and templates/*.html
giveaway.py     what to plot a residual against, so that an effect shows itself; variables.py: all there is to choose from
stages.py       the predictions that are compared: as described, calibrated, with the effects
console.py      the same in a terminal
provenance.py   versions, seed, data hash, command, date
numbers.py      values with units and errors, as people read them
plots.py        the house style of the figures
"""

from twin.report.console import beforehand, console
from twin.report.contents import contents
from twin.report.provenance import provenance, stamp
from twin.report.sentence import sentence
from twin.report.write import write

__all__ = ["beforehand", "console", "contents", "provenance", "sentence", "stamp", "write"]
