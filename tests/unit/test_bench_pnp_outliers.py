"""Pose problems with outliers: made as the protocol says, every robust solver found there, scored against the good."""

import math
import pickle
from functools import cache

import numpy as np
import pytest

from uwsim import commands
from uwsim.bench.definition import read_definition
from uwsim.bench.pnp_outliers import page, task
from uwsim.bench.pnp_outliers.protocol import Outliers
from uwsim.bench.pnp_outliers.settings import FIELD, Problems
from uwsim.bench.records import markdown, read_result
from uwsim.bench.run import TASKS, run, source
from uwsim.discovery import discover, missing_packages
from uwsim.metrics.pose import rotation_error_deg
from uwsim.pose import robust_solvers
from uwsim.pose.robust_solvers import all_points, opencv_ransac, oracle_inliers, robust
from uwsim.pose.solution import Solution, Status
from uwsim.validation import validated, with_tuples

SOLID = {"points": 12, "outliers_percent": [0.0, 25.0, 50.0], "quick_outliers_percent": [25.0]}
FOUND = discover(robust_solvers)


def protocol(trials: int = 20, parts: dict | None = None) -> Outliers:
    values = {"seed": 4, "trials": trials, "quick_trials": 10, "resamples": 60, "focal_px": 1000.0, "noise_px": 0.5,
              "threshold_std": 3.0, "parts": parts or {"solid": SOLID}}  # fmt: skip
    return validated(Outliers, with_tuples(values), where="here")


@cache
def made(trials: int = 20, **change) -> Problems:
    return Problems(protocol(trials, {"solid": SOLID | change}), quick=False)


def true_places(placed) -> np.ndarray:
    """Return where the true pose puts the points (B, n, 2), on the plane z = 1."""
    camera_m = placed.points_m @ np.swapaxes(placed.rotation, 1, 2) + placed.translation_m[:, None]
    return camera_m[..., :2] / camera_m[..., 2:]


def off(problems: Problems, name: str) -> np.ndarray:
    """Return how far images are from there (B, n)."""
    batch = problems.spoilt(name).batch
    return np.linalg.norm(true_places(batch.placed) - batch.points, axis=2)


@pytest.mark.parametrize("change", [{}, {"wrong": "swapped"}, {"flat": True}])
def test_as_many_points_are_wrong_as_the_setting_says(change):
    """Expected: 3 of 12 far from their places, the others within noise. Control: without outliers all are."""
    problems = made(**change)
    spoilt, distance = problems.spoilt("solid/25 %"), off(problems, "solid/25 %")
    assert np.all(spoilt.inliers.sum(axis=1) == 9)
    assert distance[spoilt.inliers].max() < 6 * problems.noise
    assert np.median(distance[~spoilt.inliers]) > 100 * problems.noise
    assert not np.all(spoilt.inliers == spoilt.inliers[0])
    assert off(problems, "solid/0 %").max() < 6 * problems.noise
    assert spoilt.good.points.shape == (20, 9, 2) and spoilt.good.placed.points_m.shape == (20, 9, 3)
    assert (np.ptp(spoilt.batch.placed.points_m[..., 2]) == 0) == ("flat" in change)


def test_images_of_outliers_are_drawn_over_the_field_or_are_each_others():
    drawn, swapped = made().spoilt("solid/50 %"), made(wrong="swapped").spoilt("solid/50 %")
    assert np.abs(drawn.batch.points[~drawn.inliers]).max() <= FIELD
    assert np.std(drawn.batch.points[~drawn.inliers]) == pytest.approx(FIELD / math.sqrt(3), rel=0.1)
    places = true_places(swapped.batch.placed)
    for image, place, good in zip(swapped.batch.points, places, swapped.inliers, strict=True):
        wrong = np.flatnonzero(~good)
        gaps = np.linalg.norm(image[wrong, None] - place[None, wrong], axis=2)
        assert gaps.min(axis=1).max() < 6 * made().noise
        # each once, and none its own
        taken = gaps.argmin(axis=1)
        assert sorted(taken) == list(range(6)) and np.all(taken != np.arange(6))


def test_problems_are_the_same_alone_and_among_others():
    """Control: another share, another part and another seed are other problems."""
    alone = Problems(protocol(20, {"solid": SOLID | {"outliers_percent": [25.0]}}), quick=False)
    among = Problems(protocol(20, {"other": SOLID, "solid": SOLID}), quick=False)
    one, same = (problems.spoilt("solid/25 %") for problems in (alone, among))
    np.testing.assert_array_equal(one.batch.points, same.batch.points)
    np.testing.assert_array_equal(one.inliers, same.inliers)
    for other in (among.spoilt("other/25 %"), among.spoilt("solid/50 %")):
        assert not np.array_equal(other.batch.placed.rotation, one.batch.placed.rotation)
    shifted = Problems(protocol().model_copy(update={"seed": 5}), quick=False)
    assert not np.array_equal(shifted.spoilt("solid/25 %").batch.points, one.batch.points)
    assert shifted.sha256 != made().sha256
    with pytest.raises(ValueError, match="'x', allowed: one of the 3"):
        made().spoilt("x")


@pytest.mark.parametrize(
    ("change", "part"),
    [
        (
            {"outliers_percent": [75.0], "quick_outliers_percent": [75.0]},
            "got 75.0 of 12 points, allowed: 0 to 66.6667",
        ),
        ({"outliers_percent": [-5.0]}, "outliers_percent"),
        ({"outliers_percent": [25.0, 25.0]}, "one stands twice"),
        ({"quick_outliers_percent": [10.0]}, "got 10.0, allowed: of outliers_percent"),
        ({"wrong": "swapped", "outliers_percent": [8.0], "quick_outliers_percent": [8.0]}, "two and more to swap"),
        ({"wrong": "none"}, "anywhere"),
        ({"points": 3}, "points"),
        ({"quick_outliers_percent": None}, "none has quick_outliers_percent"),
        ({"noise": 1.0}, "noise"),
    ],
)
def test_a_broken_protocol_is_refused_in_one_line(change, part):
    with pytest.raises(ValueError) as caught:
        protocol(parts={"solid": SOLID | change})
    assert "\n" not in str(caught.value) and part in str(caught.value)


def given(module, case) -> dict:
    return {name: case.makers[name]() for name in module.NEEDS}


@pytest.mark.parametrize("name", sorted(FOUND))
def test_every_robust_solver_found_is_a_solver(name):
    """Exact without outliers, batched as alone, the input left as it is, nothing of what is not asked for.

    Control: all but the do-nothing entry are right among outliers.
    """
    module = FOUND[name]
    if missing := missing_packages(module):
        pytest.skip(f"not installed: {', '.join(missing)}")
    assert module.MINIMUM_POINTS >= 4 and module.PLANAR_OK is True and set(module.NEEDS) <= set(task.TASK.inputs)
    case = task.case(made(), "solid/25 %")
    batch = case.truth.spoilt.batch
    points_m, points = batch.placed.points_m.copy(), batch.points.copy()
    found = module.solve(points_m, points, **given(module, case))
    np.testing.assert_array_equal(points_m, batch.placed.points_m)
    np.testing.assert_array_equal(points, batch.points)
    assert isinstance(found, Solution) and found.rotation.shape == (20, 3, 3)
    error_deg = rotation_error_deg(found.rotation[found.ok], batch.placed.rotation[found.ok])
    assert (np.median(error_deg) < 0.5) == (name != "all_points")
    exact = task.case(made(), "solid/0 %").truth.spoilt.batch
    again = module.solve(exact.placed.points_m, exact.points, **given(module, task.case(made(), "solid/0 %")))
    assert again.ok.all() and np.median(rotation_error_deg(again.rotation, exact.placed.rotation)) < 0.2
    few = module.MINIMUM_POINTS - 1
    keywords = given(module, case) | ({"inliers": np.ones((20, few), bool)} if "inliers" in module.NEEDS else {})
    with pytest.raises(ValueError, match=f"got {few} points, allowed: at least {module.MINIMUM_POINTS}"):
        module.solve(points_m[:, :few], points[:, :few], **keywords)


def test_a_problem_without_a_pose_is_none():
    """Nothing but outliers: refused, and its neighbours solved. Control: the do-nothing entry gives a pose."""
    case = task.case(made(), "solid/25 %")
    batch, keywords = case.truth.spoilt.batch, {"threshold": case.makers["threshold"]()}
    points = batch.points.copy()
    points[3] = np.random.default_rng(0).uniform(-0.5, 0.5, (12, 2))
    for module in (robust, opencv_ransac):
        found = module.solve(batch.placed.points_m, points, **keywords)
        assert found.status.tolist() == [Status.OK] * 3 + [Status.NO_POSE] + [Status.OK] * 16
        assert np.isnan(found.translation_m[3]).all() and found.ok.sum() == 19
    assert all_points.solve(batch.placed.points_m, points).ok[3]


def scores_of(module, case, change=lambda one: one):
    class Says:
        MINIMUM_POINTS, PLANAR_OK, NEEDS = 4, True, ("inliers",)

        @staticmethod
        def solve(points_m, points, *, inliers):
            return change(module.solve(points_m, points, inliers=inliers))

    return task.score(Says, "says", ("inliers",), case)


def test_right_wrong_and_none_are_counted():
    """The oracle is right; every fourth problem turned by 10 deg is wrong, every fifth without a pose is none."""
    case = task.case(made(), "solid/50 %")
    assert scores_of(oracle_inliers, case)["right_percent"] == 100
    tenth = np.array([[math.cos(0.17), -math.sin(0.17), 0], [math.sin(0.17), math.cos(0.17), 0], [0, 0, 1]])

    def spoil(one: Solution) -> Solution:
        rotation, ok = one.rotation.copy(), one.ok.copy()
        rotation[::4] = tenth @ rotation[::4]
        ok[1::5] = False
        return one._replace(rotation=rotation, ok=ok)

    found = scores_of(oracle_inliers, case, spoil)
    # of 20: 0, 4, 8, 12, 16 turned, 1, 6, 11, 16 without a pose
    assert (found["right_percent"], found["wrong_percent"], found["no_pose_percent"]) == (60, 20, 20)
    assert found["rotation_ratio_to_ml"] > scores_of(oracle_inliers, case)["rotation_ratio_to_ml"]
    shifted = scores_of(oracle_inliers, case, lambda one: one._replace(translation_m=1.05 * one.translation_m))
    assert shifted["wrong_percent"] == 100
    none = scores_of(oracle_inliers, case, lambda one: one._replace(ok=np.zeros(20, bool)))
    assert none["no_pose_percent"] == 100 and math.isnan(none["rotation_ratio_to_ml"])
    with pytest.raises(ValueError, match="pnp_outliers: says: case solid/50 %: returned no Solution"):
        scores_of(oracle_inliers, case, lambda one: None)


def test_ml_is_that_of_the_good_points():
    """The oracle's errors are ML*'s, and near the bound: medians of 20 scatter by a third. Control: with outliers."""
    case = task.case(made(), "solid/50 %")
    found = scores_of(oracle_inliers, case)
    assert found["rotation_ratio_to_ml"] == pytest.approx(1, abs=1e-3)
    assert 0.5 < found["rotation_error_to_bound_ratio"] < 1.7
    assert task.score(all_points, "all_points", (), case)["rotation_ratio_to_ml"] > 50


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    path = tmp_path_factory.mktemp("definition") / "mine.toml"
    path.write_text(
        'task = "pnp_outliers"\ndescription = "x"\ndo_nothing = "all_points"\noracle = "oracle_inliers"\n'
        'quick_cases = 9\nalgorithms = ["all_points", "opencv_ransac", "poselib_ransac", "robust", "msac", '
        '"oracle_inliers"]\n[variants]\nmsac = { algorithm = "robust", keywords = { method = "msac" } }\n'
        "[outliers]\nseed = 4\ntrials = 10\nquick_trials = 10\nresamples = 60\nfocal_px = 1000.0\nnoise_px = 0.5\n"
        "threshold_std = 3.0\n[outliers.parts.solid]\npoints = 12\noutliers_percent = [0.0, 40.0]\n"
        "quick_outliers_percent = [40.0]\n"
    )
    return run(str(path))


def values(result, metric, case):
    return {one.algorithm: one.value for one in result.records if (one.metric, one.case) == (metric, case)}


def test_a_run_needs_no_dataset(result):
    assert list(result.provenance["conditions"]) == ["solid/0 %", "solid/40 %"]
    assert result.provenance["summaries"] == ["all", "without outliers", "above 30 %"]
    right = values(result, "right_percent", "solid/40 %")
    assert right["robust"] == right["msac"] == right["oracle_inliers"] == 100
    assert right["all_points"] == 0
    assert values(result, "right_percent", "solid/0 %")["all_points"] == 100
    assert "| robust | threshold | 100 |" in markdown(result)


def test_the_folder_holds_the_page_and_all_records(tmp_path, result):
    page.write(tmp_path / "outliers", result=result, dataset=None)
    assert {path.name for path in (tmp_path / "outliers").iterdir()} == {
        "README.md", "pnp_outliers.json.gz", "outliers.png"
    }  # fmt: skip
    assert read_result(tmp_path / "outliers" / "pnp_outliers.json.gz").records == result.records
    text = (tmp_path / "outliers" / "README.md").read_text()
    assert "2 settings of 10 problems; seed 4." in text
    assert "12 points, solid, images of outliers anywhere:\n\n| outliers | 0 % | 40 % |" in text
    assert "| `robust` | 100; 0; 0 | 100; 0; 0 |" in text
    assert "| `all_points` (do-nothing) | 100; 0; 0 | 0; 100; 0 |" in text
    assert "quick run" not in text
    assert commands.page_of("any", "pnp_outliers", algorithms=None) is page


def test_the_shipped_benchmark_reads_and_worker_processes_can_open_it():
    title, definition = read_definition("pnp_outliers")
    found, open_problems = source(title, TASKS["pnp_outliers"], definition, None, quick=True)
    assert pickle.loads(pickle.dumps(open_problems))().settings == found.settings
    assert len(found.settings) <= definition.quick_cases
    shares = {one.percent for one in Problems(definition.outliers, quick=False).settings.values()}
    assert min(shares) == 0 and max(shares) == 60
    assert set(definition.algorithms) == {*FOUND, *definition.variants}


def test_a_table_of_outliers_is_for_this_task_alone(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('task = "pnp_outliers"\ndescription = "x"\ndo_nothing = "all_points"\nquick_cases = 1\n')
    with pytest.raises(ValueError, match="outliers: missing, allowed: a table with task pnp_outliers"):
        read_definition(str(path))
