"""report.html: complete, self-contained, and deaf to what file names and titles try to say."""

import base64
import json
import re
from dataclasses import replace
from html import unescape
from html.parser import HTMLParser

import numpy as np
import pytest
from plotly.offline import get_plotlyjs
from small_diagnosis import SETTINGS, diagnosis, recording

from twin.diagnosis.checks.identifiability import Visibility
from twin.effects import catalogue
from twin.report import provenance, sentence
from twin.report.page import page
from twin.report.plots.effect_plot import choose_residual_plots
from twin.report.plots.figures import MOST_POINTS

SECTIONS = (
    "before-after",
    "effects",
    "loops",
    "residual",
    "shapes",
    "tip",
    "left",
    "attribution",
    "next",
    "identifiability",
    "parameters",
    "noise",
    "notices",
    "made",
)
PLOTTED = {"azimuth", "clock", "elapsed", "loop", "payload", "position", "rate", "reach", "temperature", "tension", "torque"}
VERDICTS = ("noise", "explained", "partly_explained", "unexplained")


class Scripts(HTMLParser):
    """Script elements and their text, as a browser would cut them; and every attribute that could load something."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.scripts: list[tuple[dict, str]] = []
        self.tags: set[str] = set()
        self.loads: list[str] = []
        self._inside = False
        self.feed(html)

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        self.loads += [
            f"{tag} {k}={v}" for k, v in attrs if k in ("src", "srcset", "data") or (k == "href" and not str(v).startswith("#"))
        ]
        self.loads += [f"{tag} {k}" for k, _ in attrs if k.startswith("on")]
        if tag == "script":
            self.scripts.append((dict(attrs), ""))
            self._inside = True

    def handle_endtag(self, tag):
        self._inside = self._inside and tag != "script"

    def handle_data(self, data):
        if self._inside:
            kind, text = self.scripts[-1]
            self.scripts[-1] = (kind, text + data)


def render(d) -> str:
    return page(d, provenance(d.prepared.recording, SETTINGS, "twin diagnose here"))


def figures(html: str) -> list[dict]:
    return [
        json.loads(text)
        for kind, text in Scripts(html.replace(get_plotlyjs(), "")).scripts
        if kind.get("type") == "application/json"
    ]


def points(trace: dict) -> int:
    x = trace.get("x", [])
    return len(np.frombuffer(base64.b64decode(x["bdata"]), x["dtype"])) if isinstance(x, dict) else len(x)


@pytest.mark.parametrize("verdict", VERDICTS)
def test_every_verdict_has_its_sentence_sections_source_and_figures(verdict):
    d = diagnosis(verdict)
    html = render(d)
    assert sentence(d) in unescape(html)
    for name in SECTIONS:
        assert f'<section id="{name}">' in html
    assert html.count("hardware: by hand") >= 6
    drawn = figures(html)
    assert len(drawn) == 5  # error, residual twice, shapes, tip
    assert all(sum(map(points, f["data"])) > 0 for f in drawn)


def test_the_trial_in_time_is_one_in_which_its_marker_was_seen():
    """Markers may be put on anew: of the outermost one that any held-out trial shows, the trial that shows it."""
    d = diagnosis(held_out_trials=(1, 4))
    assert "circle_4" in shown(d)  # pulled further, so further apart
    columns = {m: [j for j, o in enumerate(d.prepared.outputs) if o.channel.name.startswith(m)] for m in ("disk_7", "disk_8")}
    for gone, trial, marker in (([(4, "disk_8")], "circle_1", "disk_8"), ([(1, "disk_8"), (4, "disk_8")], "circle", "disk_7")):
        measured = [y.copy() for y in d.prepared.measured]
        for k, m in gone:
            measured[k][:, columns[m]] = np.nan
        said = shown(replace(d, prepared=replace(d.prepared, measured=tuple(measured))))
        assert trial in said
        assert marker in said


def shown(d) -> str:
    return render(d).partition('<section id="tip">')[2].partition("</section>")[0]


@pytest.mark.parametrize("named", [True, False], ids=["with effects", "without"])
def test_the_row_that_stands_out_is_the_twin_s(named):
    """Not that of the polynomial, which comes after it."""
    d = diagnosis() if named else replace(diagnosis(), claims=())
    d = replace(d, errors=replace(d.errors, without_physics=dict.fromkeys(d.errors.after, 1e-3)))
    html = render(d)
    assert "polynomial, no physics" in html
    assert set(re.findall(r'<tr class="mine"><td>([^<]*)', html)) == {"with the effects" if named else "calibrated"}


def test_it_loads_nothing():
    html = render(diagnosis())
    rest = html.replace(get_plotlyjs(), "")
    assert len(rest) < 400_000
    assert not re.search(r"https?://|//cdn|@import|url\(", rest)
    found = Scripts(rest)
    assert not found.loads
    assert not found.tags & {"link", "iframe", "img", "object", "embed"}
    assert "default-src 'none'" in rest


@pytest.mark.parametrize(
    "attack", ["<script>alert(1)</script>", "</script><img src=x onerror=alert(1)>", "<!--<script>", '"><b>&amp;']
)
def test_text_of_the_data_stays_text(attack):
    words = attack.replace("/", "\N{DIVISION SLASH}") if "/" in attack else attack
    plain = render(diagnosis(of=recording()))
    r = replace(recording(trial=words), title=attack, source=f"hardware: {attack}")
    d = diagnosis(of=r, notices=(attack,), description=attack)
    html = page(d, provenance(r, SETTINGS, attack))
    before, after = Scripts(plain.replace(get_plotlyjs(), "")), Scripts(html.replace(get_plotlyjs(), ""))
    assert len(after.scripts) == len(before.scripts)
    assert after.tags == before.tags
    assert not after.loads
    assert not any("alert" in text for kind, text in after.scripts if kind.get("type") != "application/json")
    assert attack in unescape(html)
    figures(html)


def test_figures_stay_small_however_long_the_recording():
    html = render(diagnosis(of=recording(n=6000)))
    assert all(sum(map(points, f["data"])) <= MOST_POINTS + 200 for f in figures(html))
    assert len(html) < len(get_plotlyjs()) + 400_000


def test_missing_values_and_few_channels_are_no_obstacle():
    r = recording()
    holes = []
    for k, t in enumerate(r.trials):
        x = np.array(t.values["disk_8_x"])
        x[:: 2 if k else 1] = np.nan
        holes.append({"disk_8_x": x})
    render(diagnosis(of=r.with_values(holes, r.source)))
    html = render(diagnosis(of=recording(displacement=True, markers=False)))
    assert ">Shapes<" not in html
    assert ">Shapes<" in render(diagnosis())


def test_the_loop_is_found_where_it_is():
    d = diagnosis()
    (g,) = choose_residual_plots(d)
    assert d.prepared.outputs[g.column].channel.name == "disk_8_x"
    assert g.variable.title == "tension of tendon 2 (N)"
    assert g.variable.is_loop
    (left,) = choose_residual_plots(diagnosis("unexplained"))
    assert left.variable.is_loop
    assert left.variable.title == g.variable.title


def told(d) -> list[list[str]]:
    """The cells of the table on what the data can tell, row by row."""
    body = render(d).partition('<section id="identifiability">')[2].partition("</table>")[0]
    return [[unescape(re.sub("<[^>]*>", "", cell)) for cell in re.findall("<td.*?</td>", row)] for row in body.split("<tr")[2:]]


def test_what_the_data_can_tell_is_a_row_an_effect():
    assert told(diagnosis()) == [
        ["tendon friction", "0.10", "0.10", "backbone creep, 20 %", "mu 0.0040", ""],
        ["time delay", "0.10", "0.30", "actuator lag, 94 %", "delay 0.010 s", "two rates of pull, ten times apart"],
        ["tendon elasticity (stretch)", "not detectable: needs tendon displacements"],
    ]


def test_an_effect_hidden_for_no_known_reason_says_so():
    hidden = Visibility("tendon_elasticity", np.inf, np.inf, 0.0, "", ("stretch", np.inf, "m/N"), ())
    assert told(diagnosis(identifiability=(hidden,))) == [
        ["tendon elasticity", "not detectable: no measured channel responds to it"]
    ]


@pytest.mark.parametrize("law", sorted(catalogue()))
def test_every_law_names_something_to_plot_against(law):
    assert catalogue()[law].plot_against in PLOTTED
