"""Policies that are learned from what was shown: small data, short trainings."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from twin.foundation.errors import DataError, UnknownNameError
from twin.robots import load
from twin.tasks.imitation import lerobot
from twin.tasks.imitation.demonstrate import hand_body
from twin.tasks.imitation.hand_model import draw_alignment, draw_built_hand, finger_twins
from twin.tasks.imitation.imitate import make_policy
from twin.tasks.imitation.policy import CHUNK_FRAMES, DIRECTIONS_KEPT, FRAMES_AHEAD, FRAMES_BACK, CloningNetwork, PolicyExecutor
from twin.tasks.imitation.policy_training import PolicyTrainingSpec, train_or_load
from twin.tasks.imitation.sensor_drift import drift_gains, estimate_drift_gains

FRAMES, WIDTH = 40, 72


def course(rng: np.random.Generator) -> np.ndarray:
    """(FRAMES, WIDTH) m: closes, waits, then goes aside; some faster and further than others."""
    t, way = np.arange(FRAMES) / FRAMES, np.random.default_rng(0).normal(size=(DIRECTIONS_KEPT, WIDTH))
    closes = np.clip(t / rng.uniform(0.25, 0.35), 0.0, 1.0)
    aside = np.clip((t - 0.6) / 0.3, 0.0, 1.0) * rng.uniform(0.8, 1.2)
    return 0.02 * (closes[:, None] * way[0] + aside[:, None] * way[1]) + 1e-5 * rng.normal(size=(FRAMES, WIDTH))


@pytest.fixture
def shown(tmp_path: Path) -> Path:
    rng = np.random.default_rng(1)
    for i in range(12):
        lerobot.write_episode(tmp_path, i, {"observation.state": course(rng), "observation.resistance": np.ones((FRAMES, 12))}, 25)
    return tmp_path


class Stopped(Exception):
    pass


def done(policy: CloningNetwork, seed: int = 0) -> np.ndarray:
    """(FRAMES, WIDTH): what it wants while fingers stay where they hang."""
    act = PolicyExecutor(policy, seed)
    return np.stack([act(0.0 * course(np.random.default_rng(0))[0]) for _ in range(FRAMES)])


@pytest.mark.parametrize("kind", ["diffusion", "cloning"])
def test_what_is_taught_does_what_was_shown_and_what_is_not_does_not(shown: Path, kind: str) -> None:
    """From the mean course demonstrations stray by up to 21 % of how far it goes, RMS; what is taught by up to 22 (seen), what
    is not by most of it."""
    courses = [e["observation.state"] for e in lerobot.read_episodes(shown, ("observation.state",))]
    mean = np.mean(courses, axis=0)[np.minimum(np.arange(FRAMES) + FRAMES_AHEAD, FRAMES - 1)]
    size = np.sqrt(mean.var(axis=0).mean())
    both = {epochs: done(train_or_load(PolicyTrainingSpec(kind, "shape", epochs, epochs), shown)) for epochs in (0, 100)}
    off = {epochs: np.sqrt(((wanted - mean) ** 2).mean()) for epochs, wanted in both.items()}
    assert off[0] > 0.5 * size
    assert off[100] < 0.3 * size
    card = json.loads((shown / "policies" / f"{kind}-shape-100.json").read_text("utf-8"))
    assert card["loss"][-1] < 0.2 * card["loss"][0]
    assert {"torch", "diffusers", "numpy"} == card["versions"].keys()
    assert len(card["data"]) == 64


def test_a_stop_in_between_and_a_second_run_change_no_weight(shown: Path) -> None:
    lesson = PolicyTrainingSpec("diffusion", "shape", 3, 40)
    whole = train_or_load(lesson, shown).state_dict()
    lesson.path(shown).unlink()

    def stop(words: str) -> None:
        raise Stopped

    with pytest.raises(Stopped):
        train_or_load(lesson, shown, stop)
    assert not lesson.path(shown).exists()
    again = train_or_load(lesson, shown).state_dict()
    kept = train_or_load(lesson, shown, stop).state_dict()  # read, not taught
    other = train_or_load(PolicyTrainingSpec("diffusion", "shape", 4, 40), shown).state_dict()
    for name, value in whole.items():
        assert value.equal(again[name]), name
        assert value.equal(kept[name]), name
    assert not whole["body.0.weight"].equal(other["body.0.weight"])
    assert [p.name for p in (shown / "policies").glob("*.checkpoint")] == []


def test_weights_of_other_demonstrations_are_refused(shown: Path) -> None:
    lesson = PolicyTrainingSpec("cloning", "shape", 0, 1)
    train_or_load(lesson, shown)
    episode = {"observation.state": course(np.random.default_rng(7)), "observation.resistance": np.ones((FRAMES, 12))}
    lerobot.write_episode(shown, 12, episode, 25)
    with pytest.raises(DataError, match="other demonstrations; delete it"):
        train_or_load(lesson, shown)
    lesson.path(shown).write_bytes(b"no weights")
    with pytest.raises(DataError, match="no policy of this program"):
        train_or_load(lesson, shown)


def test_wrong_names_and_empty_folders_are_said(shown: Path, tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match="available: cloning, diffusion, nearest"):
        make_policy(PolicyTrainingSpec("difusion", "shape", 0), shown)
    for kind in ("nearest", "diffusion"):
        with pytest.raises(UnknownNameError, match="did you mean 'shape'"):
            make_policy(PolicyTrainingSpec(kind, "shap", 0), shown)
        with pytest.raises(DataError, match="no episodes there"):
            make_policy(PolicyTrainingSpec(kind, "shape", 0), tmp_path / "none")


def test_a_chunk_is_what_was_shown_next() -> None:
    policy, x = CloningNetwork(WIDTH), [course(np.random.default_rng(k)) for k in range(3)]
    policy.fit_scaling(x)
    o, a = policy.training_pairs(x)
    y = policy.normalise(x[1])
    i = FRAMES + 20
    np.testing.assert_allclose(o[i], np.concatenate([y[20], y[20 - FRAMES_BACK], [0.5]]), atol=1e-6)
    np.testing.assert_allclose(a[i].reshape(CHUNK_FRAMES, DIRECTIONS_KEPT), y[21 : 21 + CHUNK_FRAMES], atol=1e-6)
    np.testing.assert_allclose(
        a[-1].reshape(CHUNK_FRAMES, DIRECTIONS_KEPT), policy.normalise(x[2])[-1:].expand(CHUNK_FRAMES, DIRECTIONS_KEPT), atol=1e-6
    )
    assert float(policy.normalise(np.concatenate(x)).abs().max()) == pytest.approx(1.0, abs=1e-3)  # of numbers of seven digits
    # what KEPT directions leave of them is noise: 1e-5 m
    np.testing.assert_allclose(policy.denormalise(y), x[1], atol=6e-5)


def test_free_motion_tells_by_what_the_cords_drifted() -> None:
    """To 0.5 %, the smallest drift it looks for, of up to 8.3 % (0.14 % was seen); nothing is undone of a finger that did not."""
    hand = load("hand")
    values = draw_built_hand(hand, 1)
    twins, rng = finger_twins(hand, draw_alignment(hand, values, 1)), np.random.default_rng(0)
    drifted = drift_gains(0.083, 1.0, (3, 4), 1)
    assert 0.05 < np.abs(drifted - 1.0).max() <= 0.083
    np.testing.assert_allclose(drift_gains(0.083, 0.5, (3, 4), 1) - 1.0, 0.5 * (drifted - 1.0), rtol=1e-12)
    drifted[2] = 1.0
    found = estimate_drift_gains(hand_body(hand, values), hand.gravity, twins, drifted, rng)
    np.testing.assert_allclose(found, drifted, rtol=5e-3)
    np.testing.assert_array_equal(found[2], 1.0)
