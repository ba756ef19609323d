"""Trials of tasks that are kept and looked at: what is drawn is what was stepped."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest
import viser

from tests.viewer_page import Look, browser, look, serving
from twin.cli.use.view import View
from twin.foundation.errors import DataError
from twin.mechanics.silicone.motion.things import Thing
from twin.robots import load
from twin.tasks import Demonstrator, Outcome, TaskTrial, make_task, tasks
from twin.tasks.imitation.demonstrate import hand_body
from twin.tasks.imitation.episode_store import (
    DEMONSTRATIONS,
    EPISODES_FOLDER,
    STEPS_PER_FRAME,
    Episode,
    EpisodeInfo,
    episode_path,
    episode_sets,
    read_episode,
    read_info,
    store_episode,
)
from twin.tasks.imitation.hand_model import draw_built_hand
from twin.viewer import TaskPanel
from twin.viewer import panel as panel_module
from twin.viewer import trials as trials_module
from twin.viewer.drawing.drawn_trial import DrawnTrial, read_drawn_trial
from twin.viewer.drawing.solids import part_mesh

__all__ = ["browser", "look"]  # fixtures
HAND, SEED, POLICY = load("hand"), 1, "nearest-shape-hand1-seed0"


@pytest.fixture(scope="module")
def lifted() -> TaskTrial:
    """A person's, until the table has sunk for 0.4 s."""
    rng = np.random.default_rng(5)
    trial = TaskTrial(make_task("hold"), hand_body(HAND, draw_built_hand(HAND, SEED)), HAND.gravity, rng)
    person = Demonstrator.draw(rng, 3, trial.task.push_strength)
    while trial.state.time < 1.999:
        trial.push(person)
    return trial


@pytest.fixture(scope="module")
def folder(lifted: TaskTrial, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two trials of a person's and one of a policy's, which never reached its plug."""
    where = tmp_path_factory.mktemp("tasks") / "shown"
    for number in (0, 1):
        store_episode(
            episode_path(where, DEMONSTRATIONS, number),
            Episode.of(lifted, EpisodeInfo("hold", "hand", SEED, DEMONSTRATIONS, number)),
        )
    idle = TaskTrial(make_task("insert"), hand_body(HAND, draw_built_hand(HAND, SEED)), HAND.gravity, np.random.default_rng(3))
    for _ in range(20):
        idle.pull(np.full_like(idle.state.shortening, -15e-3))
    store_episode(episode_path(where, POLICY, 4), Episode.of(idle, EpisodeInfo("insert", "hand", SEED, POLICY, 4)))
    return where


@pytest.fixture
def server() -> Iterator[viser.ViserServer]:
    made = viser.ViserServer(host="127.0.0.1", port=8695, verbose=False)
    yield made
    made.stop()


# ---- what is kept ----------------------------------------------------------------------------------------------------------------


def test_what_is_kept_is_what_was_stepped(lifted: TaskTrial, folder: Path) -> None:
    """25 frames a second and the last, to single precision; the object and its table where MuJoCo has them in the end."""
    found = read_episode(episode_path(folder, DEMONSTRATIONS, 1))
    assert found.info == EpisodeInfo("hold", "hand", SEED, DEMONSTRATIONS, 1)
    assert found.outcome is lifted.outcome()
    assert found.things == lifted.things
    np.testing.assert_allclose(np.diff(found.time), 0.02 * STEPS_PER_FRAME, rtol=1e-5)
    assert len(found.time) == 51
    np.testing.assert_allclose(found.nodes[-1], lifted.state.nodes, atol=1e-8)
    np.testing.assert_allclose(found.tension[-1], lifted.state.tension, atol=1e-6)
    data, model = lifted.scene.data, lifted.scene.model
    names = [t.name for t in found.things]
    assert names == ["object", "table"]
    np.testing.assert_allclose(found.place[-1, 0], data.qpos[-7:-4], atol=1e-7)
    np.testing.assert_allclose(found.turn[-1, 0], data.qpos[-4:], atol=1e-6)
    np.testing.assert_allclose(found.place[-1, 1], model.body("table").pos, atol=1e-7)
    assert found.place[-1, 1, 2] - found.place[0, 1, 2] == pytest.approx(0.05 * 0.38)  # m: 50 mm/s from the step after 1.6 s on


def test_the_same_trial_gives_the_same_file(lifted: TaskTrial, folder: Path, tmp_path: Path) -> None:
    store_episode(tmp_path / "again.parquet", Episode.of(lifted, EpisodeInfo("hold", "hand", SEED, DEMONSTRATIONS, 0)))
    assert (tmp_path / "again.parquet").read_bytes() == episode_path(folder, DEMONSTRATIONS, 0).read_bytes()


def test_persons_come_first_and_one_set_is_a_folder_too(folder: Path) -> None:
    assert {name: len(files) for name, files in episode_sets(folder).items()} == {DEMONSTRATIONS: 2, POLICY: 1}
    assert list(episode_sets(folder)) == [DEMONSTRATIONS, POLICY]
    assert list(episode_sets(folder / EPISODES_FOLDER / POLICY)) == [POLICY]


def test_what_is_no_trial_is_said(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="holds no stored trials; twin demonstrate"):
        episode_sets(tmp_path)
    (tmp_path / "000.parquet").write_bytes(b"PAR1")
    with pytest.raises(DataError, match=r"000.parquet is no trial of this program \(twin-trial/1\)"):
        read_info(tmp_path / "000.parquet")


# ---- what is drawn ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", sorted(tasks()))
def test_things_are_drawn_as_mujoco_has_them(name: str) -> None:
    """Every solid reaches as far along each axis of MuJoCo's geometry as that says; what is round to what its facets leave."""
    things = make_task(name).draw_things(np.random.default_rng(2))
    spec = mujoco.MjSpec()
    for thing in things:
        thing.add(spec)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for thing in things:
        for k, part in enumerate(thing.solids):
            geom = data.geom(thing.name if not k else f"{thing.name} {k}")
            own = (_placed(thing, part_mesh(part).vertices) - geom.xpos) @ geom.xmat.reshape(3, 3)
            size = model.geom(geom.id).size
            far = {"sphere": size[[0, 0, 0]], "cylinder": size[[0, 0, 1]], "box": size}[part.shape]
            np.testing.assert_allclose(own.max(axis=0), far, rtol=0.01)
            np.testing.assert_allclose(own.min(axis=0), -far, rtol=0.01)


def _placed(thing: Thing, points: np.ndarray) -> np.ndarray:
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, np.array(thing.turn))
    return points @ turn.reshape(3, 3).T + thing.place


def test_fingers_are_drawn_where_mujoco_s_flexes_are(lifted: TaskTrial, folder: Path) -> None:
    """The last point of a skin is its tip, on the axis, where the flex has a vertex; to what it moves in a step of 2.5 ms, by which
    MuJoCo's places lag (31 um seen; it has moved by 20 mm and the fingers stand 80 mm apart)."""
    tips = read_drawn_trial(episode_path(folder, DEMONSTRATIONS, 0)).frames.skin[-1].reshape(3, -1, 3)[:, -1]
    model, vertices = lifted.scene.model, lifted.scene.data.flexvert_xpos
    for tip, first, count in zip(tips, model.flex_vertadr, model.flex_vertnum, strict=True):
        assert np.linalg.norm(vertices[first : first + count] - tip, axis=1).min() < 1e-4


def test_a_trial_of_another_lattice_is_said(lifted: TaskTrial, tmp_path: Path) -> None:
    made = Episode.of(lifted, EpisodeInfo("hold", "hand", SEED, DEMONSTRATIONS, 0))
    store_episode(tmp_path / "coarse.parquet", replace(made, nodes=made.nodes[:, :, ::2]))
    with pytest.raises(DataError, match="3 fingers of 45 nodes, the robot has 3 of 90"):
        read_drawn_trial(tmp_path / "coarse.parquet")


def test_between_frames_things_go_on_the_short_way() -> None:
    quarter = np.sqrt(0.5)
    kept: Any = SimpleNamespace(
        time=np.arange(2.0), place=np.array([[[0.0, 0, 0]], [[0.0, 0, 2.0]]]),
        turn=np.array([[[1.0, 0, 0, 0]], [[-quarter, 0, 0, -quarter]]]),
    )  # fmt: skip
    nothing: Any = None
    place, turn = DrawnTrial(kept, nothing).poses(0, 0.5)
    np.testing.assert_allclose(place, [[0, 0, 1.0]])
    assert 2.0 * np.arctan2(turn[0, 3], turn[0, 0]) == pytest.approx(np.pi / 4)


# ---- the panel -------------------------------------------------------------------------------------------------------------------


def test_the_panel_says_whose_trial_it_is_and_what_became_of_it(server: viser.ViserServer, folder: Path) -> None:
    app = TaskPanel(server, folder, 1)
    app.tick()
    assert app.scrubber.trial.value == f"1: {app.words.content.split('**')[3]}"
    assert app.words.content.startswith("**hold**, shown by hand, 1: **")
    assert "t = 0.00 s; object moved by 0.0 mm; tensions up to 0.00 N" in app.words.content
    assert "within 10 mm of its height" in app.success_words.content
    for shown, end in ((2.0, 2.0), (1.99, 1.986)):  # the slider counts hundredths, trials do not end with them
        app.scrubber.set_end(end)
        app.scrubber.time.value = app.scrubber.time.max
        assert app.scrubber.advance(0.0, end) == pytest.approx(end)
        assert app.scrubber.time.value == pytest.approx(shown, abs=0.005)
    app.set_choice.value = f"by {POLICY}"
    app._pending.append(app._change_set)  # as a click leaves it to the loop
    app.tick()
    assert app.words.content.startswith(f"**insert**, by {POLICY}, 4: **{Outcome.NOT_REACHED}**")
    assert app.scrubber.time.max == pytest.approx(0.4)


def test_it_runs_by_the_clock_and_round(server: viser.ViserServer, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    for module in (trials_module, panel_module):
        monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: now[0]))
    app = TaskPanel(server, folder)
    app.tick()
    high = app.solids._handles[0].position[2]
    app.scrubber.play.value, app.scrubber.speed.value = True, 2.0
    for _ in range(57):
        now[0] += 1.0 / 60.0
        app.tick()
    assert app.scrubber.time.value == pytest.approx(1.9)  # 0.95 s at twice the speed
    assert "t = 1.8" in app.words.content
    scale, kept = app.scene.scale, read_drawn_trial(episode_path(folder, DEMONSTRATIONS, 0)).episode
    assert app.solids._handles[1].position[2] == pytest.approx(scale * np.interp(1.9, kept.time, kept.place[:, 1, 2]), abs=1e-4)
    assert app.solids._handles[0].position[2] != high
    for _ in range(6):
        now[0] += 1.0 / 60.0
        app.tick()
    assert app.scrubber.time.value < 0.2


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ({"trial": "7"}, "has no trial 7; it has 0 to 1"),
        ({"trial": "first"}, "--trial first: trials of tasks have numbers"),
        ({"film": Path("x.gif"), "speed": 0.0}, "--speed 0: the speed of a film must be above 0"),
        ({"film": Path("nowhere/x.gif")}, "is no folder"),
    ],
)
def test_what_cannot_be_shown_of_a_task_is_said(words: dict[str, Any], said: str, folder: Path) -> None:
    with pytest.raises(DataError, match=said):
        View(what=(str(folder),), **words).run()


def test_a_folder_without_trials_and_one_with_a_robot_are_refused(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(DataError, match="trials of tasks cannot be combined"):
        View(what=(str(folder), "finger")).run()
    (tmp_path / EPISODES_FOLDER).mkdir()
    with pytest.raises(DataError, match="holds no stored trials"):
        View(what=(str(tmp_path),)).run()
    with pytest.raises(DataError, match="no such twin"):
        View(what=(str(tmp_path / EPISODES_FOLDER / "none"),)).run()


def test_a_browser_shows_a_trial_and_runs_it(look: Look, folder: Path) -> None:
    with serving(lambda server: TaskPanel(server, folder), port=8655) as here:
        page, app = look(here.address), here.app
        assert page.there()
        before = page.scene()
        page.put("time, s", "2")
        assert page.until(lambda: "t = 2.00 s" in app.words.content)
        assert page.changed(before)  # the hand has closed, the table is 19 mm lower
        assert page.page.get_by_text("shown by hand, 0:").is_visible()
        before = page.scene()
        page.choose("colour by", "tension of the tendons")
        assert page.changed(before)  # glass, and what is in it
        page.choose("whose", f"by {POLICY}")
        assert page.until(page.page.get_by_text(str(Outcome.NOT_REACHED), exact=True).is_visible)
        assert page.until(lambda: [t.name for t in app.solids._things] == ["object", "table"])
        page.page.get_by_role("checkbox").first.click()  # play
        assert page.until(lambda: 0.0 < app.scrubber.time.value < 0.4)
