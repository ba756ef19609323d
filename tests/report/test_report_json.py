"""report.json against its contract, key by key."""

import json
import math

import pytest
from small_diagnosis import SETTINGS, diagnosis, recording

from twin.report import contents, provenance

VERDICTS = ("noise", "explained", "partly_explained", "unexplained")
PROVENANCE = provenance(recording(), SETTINGS, "twin diagnose here --out there")


def is_number(x: object) -> bool:
    return isinstance(x, float | int) and not isinstance(x, bool) and math.isfinite(x)


def check_parameters(parameters: dict) -> None:
    for name, p in parameters.items():
        assert isinstance(name, str)
        assert set(p) == {"value", "std", "unit"}
        assert is_number(p["value"])
        assert p["std"] is None or is_number(p["std"])
        assert isinstance(p["unit"], str)


def check_errors(e: dict) -> None:
    assert e["unit"] == "mm"
    assert all(is_number(e[k]) for k in ("nominal", "calibrated", "after", "noise_floor"))
    assert set(e["ci95"]) == {"calibrated", "after"}
    for k, (low, high) in e["ci95"].items():
        assert low <= e[k] <= high


def check(report: dict) -> None:
    """The contract of measurements.md, section 3."""
    assert report["format"] == "twin-report/1"
    assert report["verdict"] in VERDICTS
    for e in report["effects"]:
        assert {"id", "parameters", "error_without", "probability"} <= set(e)
        check_parameters(e["parameters"])
        assert is_number(e["error_without"])
        assert 0 <= e["probability"] <= 1
    for c in report["candidates"]:
        assert {"id", "error", "probability"} <= set(c)
        assert c["error"] is None or is_number(c["error"])
        assert 0 <= c["probability"] <= 1
    together = report["correlation"]
    assert len(together["matrix"]) == len(together["parameters"])
    assert all(len(row) == len(together["parameters"]) for row in together["matrix"])
    assert all(-1.0 <= x <= 1.0 for row in together["matrix"] for x in row)
    error = report["error"]
    assert error["split"] == "held-out trials"
    assert error["trials"]
    assert all(isinstance(t, str) and not t.endswith(".csv") for t in error["trials"])
    check_errors(error)
    for kind, e in error.get("by_kind", {}).items():
        assert kind in ("position", "tendon_displacement")
        check_errors(e)
    left = report["residual"]
    assert {"structure", "worst_channel", "correlates_with", "description"} <= set(left)
    assert isinstance(left["structure"], str)
    assert all(isinstance(name, str) for name in left["correlates_with"])
    assert all(isinstance(effects, list) for effects in report["ambiguous"])
    assert report["next_experiment"] is None or isinstance(report["next_experiment"], str)


def strictly(report: dict) -> dict:
    """Through JSON and back, refusing NaN."""

    def refuse(token: str) -> None:
        raise AssertionError(f"{token} in JSON")

    return json.loads(json.dumps(report, allow_nan=False), parse_constant=refuse)


@pytest.mark.parametrize("verdict", VERDICTS)
def test_every_verdict_meets_the_contract(verdict):
    report = strictly(contents(diagnosis(verdict), PROVENANCE))
    check(report)
    assert report["verdict"] == verdict
    assert bool(report["effects"]) == (verdict in ("explained", "partly_explained"))
    assert (report["residual"]["structure"] == "none") == (verdict in ("noise", "explained"))
    assert bool(report["residual"]["correlates_with"]) == (verdict in ("partly_explained", "unexplained"))


def test_positions_are_millimetres_and_parameters_stay_si():
    report = contents(diagnosis(), PROVENANCE)
    assert report["error"]["after"] == pytest.approx(0.49)
    assert report["error"]["trials"] == ["circle_2", "circle_4"]
    assert report["effects"][0]["error_without"] == pytest.approx(0.78)
    assert report["effects"][0]["parameters"]["presliding"] == {"value": 6e-4, "std": 2e-5, "unit": "m"}
    assert report["candidates"] == [
        {
            "id": "backbone_creep",
            "error": pytest.approx(0.76),
            "probability": 0.006,
            "contribution": 0.0,
            "parameters": {
                "amplitude": {"value": 0.04, "std": 0.001, "unit": "1"},
                "time": {"value": 12.0, "std": None, "unit": "s"},
            },
        }
    ]
    assert "by_kind" not in report["error"]


def test_several_kinds_of_output_are_listed_and_markers_lead():
    report = strictly(contents(diagnosis(of=recording(displacement=True)), PROVENANCE))
    check(report)
    assert list(report["error"]["by_kind"]) == ["position", "tendon_displacement"]


def test_without_markers_the_first_kind_leads():
    report = strictly(contents(diagnosis(of=recording(displacement=True, markers=False)), PROVENANCE))
    check(report)
    assert "by_kind" not in report["error"]


def test_the_next_experiment_says_how_many_runs():
    words = contents(diagnosis(), PROVENANCE)["next_experiment"]
    assert words.startswith("pull tendon 3 to 2.0 N and release it: 3 runs")
    assert contents(diagnosis("noise"), PROVENANCE)["next_experiment"] is None


def test_what_the_data_can_tell_is_listed_and_never_is_null():
    friction, delay, stretch = strictly(contents(diagnosis(), PROVENANCE))["identifiability"]
    assert friction == {
        "id": "tendon_friction",
        "form": None,
        "seen": 0.1,
        "apart": 0.1,
        "share": 0.8,
        "rival": "backbone_creep",
        "smallest": {"parameter": "mu", "value": 0.004, "unit": "1"},
        "lacking": [],
    }
    assert delay["lacking"] == ["two rates of pull, ten times apart"]
    assert stretch == {
        "id": "tendon_elasticity",
        "form": "stretch",
        "seen": None,
        "apart": None,
        "share": 0.0,
        "rival": None,
        "smallest": {"parameter": "stretch", "value": None, "unit": "m/N"},
        "lacking": ["tendon displacements"],
    }


def test_provenance_repeats_the_run():
    assert PROVENANCE["seed"] == 3
    assert PROVENANCE["data_hash"] == recording().data_hash()
    assert set(PROVENANCE["versions"]) == {"twin", "python", "mujoco", "numpy", "scipy", "numba"}
    assert PROVENANCE["date"].endswith("+00:00")
