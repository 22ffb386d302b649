"""What OpenCV's pose solvers do wrong, and that ours do not: lost half turns, NaN, flags of other methods' names.

Each test has OpenCV's own answer as its control: it fails, too, when OpenCV is mended and the care is needed no more.
"""

import ast
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from uwsim.bench.photos import tags
from uwsim.discovery import discover
from uwsim.metrics.pose import rotation_error_deg, translation_error_percent
from uwsim.pose import opencv, problems, robust, solvers
from uwsim.pose.opencv import NO_METHODS, opencv_core
from uwsim.pose.solvers import opencv_ippe

ROOT = Path(__file__).parents[2]
SQUARE_M = problems.layout("pl4", edge_m=0.1)
PLACES_M = np.array([[0, 0, 1.0], [0.1, 0.05, 1.0], [-0.02, 0.01, 0.3]])
# about x and y the target shows its front, with either edge up; about z, its back
HALF_TURNS = {axis: Rotation.from_rotvec(np.pi * np.eye(3)["xyz".index(axis)]).as_matrix() for axis in "xyz"}


def seen(rotation: np.ndarray, target_m: np.ndarray = SQUARE_M) -> np.ndarray:
    """Return exact images (B, n, 2) of a target turned by a rotation, at each of the places."""
    camera_m = target_m @ rotation.T + PLACES_M[:, None]
    return camera_m[..., :2] / camera_m[..., 2:]


def plain(image: np.ndarray, target_m: np.ndarray = SQUARE_M) -> np.ndarray:
    """Return what `cv2.solvePnPGeneric` finds first with IPPE, as a user would call it: (3, 3)."""
    _, vectors, _, _ = cv2.solvePnPGeneric(target_m, image, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE)
    return cv2.Rodrigues(vectors[0])[0]


@pytest.mark.parametrize("axis", "xyz")
def test_ippe_of_a_square_turned_by_exactly_180_deg(axis):
    """Frontal (x, y), and turned in its plane (z): the pose is exact, and so are those next to it.

    Control: OpenCV's plain call is 180 deg off in the middle of the image, and never right.
    """
    rotation = np.round(HALF_TURNS[axis])
    solution = opencv_ippe.solve(np.tile(SQUARE_M, (3, 1, 1)), seen(rotation))
    assert solution.ok.all()
    assert rotation_error_deg(solution.rotation, np.tile(rotation, (3, 1, 1))).max() < 1e-6
    assert translation_error_percent(solution.translation_m, PLACES_M).max() < 1e-6
    wrong_deg = [float(rotation_error_deg(plain(image)[None], rotation[None])[0]) for image in seen(rotation)]
    assert wrong_deg[0] == pytest.approx(180, abs=1e-6)
    assert min(wrong_deg) > 5


@pytest.mark.parametrize("turn", [*HALF_TURNS.values(), np.eye(3)], ids=[*HALF_TURNS, "none"])
@pytest.mark.parametrize("points", [4, 9])
def test_ippe_of_targets_seen_face_on_up_to_round_off(turn, points):
    """In the middle of the image, tilted by 0 to 1e-6 rad: each has its pose, to 1e-6 rad.

    Control: OpenCV's plain call has NaN for some, or is off by tens of degrees.
    """
    grid_m = 0.05 * np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1]), axis=-1).reshape(9, 2)
    target_m = SQUARE_M if points == 4 else np.column_stack([grid_m, np.zeros(9)])
    tilts = np.repeat([0, 1e-12, 1e-9, 1e-8, 1e-7, 1e-6], 40)
    drawn = tilts[:, None] * np.random.default_rng(0).standard_normal((len(tilts), 3))
    rotation = Rotation.from_rotvec(drawn).as_matrix() @ turn
    camera_m = target_m @ np.swapaxes(rotation, 1, 2) + [0, 0, 1.0]
    image = camera_m[..., :2] / camera_m[..., 2:]
    solution = opencv_ippe.solve(np.tile(target_m, (len(tilts), 1, 1)), image)
    assert solution.ok.all()
    assert rotation_error_deg(solution.rotation, rotation).max() < np.degrees(1e-6)
    found = [plain(one, target_m) for one in image]
    lost = [np.isnan(one).any() or rotation_error_deg(one[None], true[None])[0] > 10
            for one, true in zip(found, rotation, strict=True)]  # fmt: skip
    assert np.mean(lost) > 0.02


@pytest.mark.parametrize("flip", [(1, -1), (1, 1), (-1, -1), (-1, 1)])
def test_a_board_of_tags_seen_face_on_has_a_pose(flip):
    """Corners as the plane has them, either way up and from either side. Control: corners 3 px off have an error."""
    K = np.array([[600.0, 0, 320], [0, 600, 240], [0, 0, 1]])
    square_m = SQUARE_M[:, :2]
    seen_px = 600 * square_m + [320, 240]
    assert tags._pose_error_px((square_m * flip)[None], seen_px[None], K) < 1e-5
    assert tags._pose_error_px((square_m * flip)[None], (seen_px + [[3, 0], [0, 0], [0, 0], [0, 0]])[None], K) > 0.1


@pytest.mark.parametrize("axis", "xyz")
@pytest.mark.parametrize("flat", [False, True])
def test_half_turns_are_not_lost_among_outliers(axis, flat):
    rng = np.random.default_rng(0)
    target_m = rng.uniform(-0.3, 0.3, (30, 3)) * ([1, 1, 0] if flat else 1)
    image = seen(np.round(HALF_TURNS[axis]), target_m)[1]
    image[:9] = rng.uniform(-0.3, 0.3, (9, 2))
    found = robust.solve_robust(target_m, image, threshold=1e-3)
    assert found.inliers.tolist() == [False] * 9 + [True] * 21
    assert rotation_error_deg(found.solution.rotation, np.round(HALF_TURNS[axis])[None])[0] < 1e-6


@pytest.mark.parametrize("flag", NO_METHODS)
def test_names_that_are_no_methods_are_refused_whatever_opencv_has(flag, monkeypatch):
    """OpenCV 4 has SOLVEPNP_DLS and SOLVEPNP_UPNP and silently takes EPnP; OpenCV 5 does not have them.

    Control: any other name that this OpenCV had would be taken.
    """
    monkeypatch.setattr(cv2, flag, 3, raising=False)
    monkeypatch.setattr(cv2, "SOLVEPNP_OTHER", 3, raising=False)
    with pytest.raises(ValueError, match=f"got {flag}, allowed: SOLVEPNP_") as caught:
        opencv_core(flag)
    allowed = str(caught.value).partition("allowed: ")[2].split(", ")
    assert {"SOLVEPNP_SQPNP", "SOLVEPNP_OTHER"} <= set(allowed)
    assert not set(allowed) & set(NO_METHODS)
    assert callable(opencv_core("SOLVEPNP_OTHER"))


def test_solvers_hand_over_names_and_opencv_its_own_number(monkeypatch):
    """The numbers moved between OpenCV 4 and 5. Control: another number under the same name is what is used."""
    asked = []

    def recorded(target, image, K, distortion, *, flags):
        asked.append(flags)
        return 0, (), (), None

    monkeypatch.setattr(cv2, "solvePnPGeneric", recorded)
    monkeypatch.setattr(cv2, "SOLVEPNP_SQPNP", 77)
    wrapped = {name: module for name, module in discover(solvers).items() if name.startswith("opencv_")}
    expected = {
        "opencv_epnp": cv2.SOLVEPNP_EPNP, "opencv_ippe": cv2.SOLVEPNP_IPPE,
        "opencv_iterative": cv2.SOLVEPNP_ITERATIVE, "opencv_sqpnp": 77,
    }  # fmt: skip
    # none is named after what OpenCV gave up
    assert set(wrapped) == set(expected)
    for name, module in wrapped.items():
        module.solve(SQUARE_M[None], seen(np.round(HALF_TURNS["x"]))[:1])
        assert asked.pop() == expected[name], name


def misused(source: str) -> list[str]:
    """Return what stands in a source that a flag must not be: names of `NO_METHODS`, and flags by number."""
    found = []
    for node in ast.walk(ast.parse(source)):
        name = getattr(node, "attr", None) or getattr(node, "id", None) or getattr(node, "value", None)
        if isinstance(name, str) and name in NO_METHODS:
            found.append(name)
        if isinstance(node, ast.Call) and getattr(node.func, "attr", "").startswith(("solvePnP", "solveP3P")):
            numbers = [one.value for one in node.keywords if one.arg == "flags" and isinstance(one.value, ast.Constant)]
            found += [f"flags={number.value}" for number in numbers]
    return found


def test_no_source_uses_a_flag_that_is_no_method_nor_a_number():
    sources = [path for folder in ("uwsim", "benchmarks", "scripts") for path in (ROOT / folder).rglob("*.py")]
    assert len(sources) > 200
    users = [path for path in sources if "SOLVEPNP_" in path.read_text(encoding="utf-8")]
    assert len(users) > 4
    # the list of what is refused is the one place for them
    found = {path.name: misused(path.read_text(encoding="utf-8")) for path in users}
    assert found.pop("opencv.py") == list(NO_METHODS)
    assert found == dict.fromkeys(found, [])


@pytest.mark.parametrize(
    "source",
    ["cv2.solvePnP(a, b, K, None, flags=cv2.SOLVEPNP_UPNP)", "opencv_core('SOLVEPNP_DLS')",
     "cv2.solvePnPGeneric(a, b, K, None, flags=8)", "from cv2 import SOLVEPNP_DLS\nx = SOLVEPNP_DLS"],
)  # fmt: skip
def test_control_misuse_is_seen(source):
    assert len(misused(source)) == 1


def test_the_module_says_what_was_given_up():
    assert all(name in opencv.__doc__ for name in NO_METHODS[:2])
