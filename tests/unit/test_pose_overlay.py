"""The pose drawn over a frame: both poses where they are, in their colours, and a caption of what is drawn.

The overlay is SVG: its lines are drawn here, in the colours of the page's style, by OpenCV; the places that are looked
at come from the synthetic frame's own projection.
"""

import re
from dataclasses import replace
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
import synthetic
from scipy.spatial.transform import Rotation

from uwsim.bench import pose
from uwsim.bench.page.pose_overlay import pose_figure
from uwsim.bench.records import Result
from uwsim.look import style

SCALE = 16
SHARES = np.linspace(0.15, 0.85, 57)
RESULT = Result("pose", {"definition": {"do_nothing": "frontal", "oracle": "oracle_corners"}}, ())
TRUTH = synthetic.camera_from_board()
# 0.4 of the diagonal of both markers
LENGTH_M = 0.4 * np.hypot(2 * synthetic.MARKER_M + synthetic.GAP_M, synthetic.MARKER_M)
OUTSIDE = np.array([5.0, 0, 0])
BEHIND = np.array([0, 0, -0.65])


def moved(shift_m=(0, 0, 0), turn_deg=0.0) -> np.ndarray:
    """Return the true pose, shifted in the camera's axes and turned about its z."""
    found = TRUTH.copy()
    found[:3, :3] = Rotation.from_euler("z", turn_deg, degrees=True).as_matrix() @ TRUTH[:3, :3]
    found[:3, 3] += shift_m
    return found


# away from the true axes, but within the picture
ESTIMATE = moved((-0.06, 0.06, 0), 40)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    return synthetic.write_dataset(tmp_path_factory.mktemp("data") / "synthetic", (3,))


@pytest.fixture
def case(dataset):
    return pose.case(dataset, pose.case_names(dataset)[0])


def colours() -> dict[str, tuple[int, ...]]:
    found = re.findall(r"\.overlay \.(\w+) \{ stroke: #([0-9a-f]{3,6})\b", style())
    return {name: tuple(bytes.fromhex(hexa if len(hexa) == 6 else 2 * hexa[0] * 3)) for name, hexa in found}


def drawn(markup: str, image: np.ndarray) -> np.ndarray:
    """Return the frame, SCALE times as large, with the lines of the overlay: opaque, with round ends."""
    svg = ElementTree.fromstring(re.search(r"<svg .*?</svg>", markup)[0])
    assert svg.get("viewBox") == f"0 0 {image.shape[1]} {image.shape[0]}"
    canvas = cv2.resize(image, None, fx=SCALE, fy=SCALE, interpolation=cv2.INTER_NEAREST)
    for path in svg.iter("path"):
        start, end = np.array(re.findall(r"[ML](\S+) ([^L]+)", path.get("d")), float)
        for first, last in dashes(float(np.linalg.norm(end - start)), path.get("stroke-dasharray")):
            ends = start + np.array([[first], [last]]) * (end - start)
            # OpenCV has pixel centres at integers
            corners = [tuple(np.round(SCALE * point - 0.5).astype(int).tolist()) for point in ends]
            width = max(1, round(SCALE * float(path.get("stroke-width"))))
            cv2.line(canvas, *corners, colours()[path.get("class")], width)
    return canvas


def dashes(length: float, pattern: str | None) -> list[tuple[float, float]]:
    """Return the parts of a line that are drawn, as shares of it."""
    if pattern is None:
        return [(0.0, 1.0)]
    on, off = map(float, pattern.split())
    return [(at / length, min(at + on, length) / length) for at in np.arange(0, length, on + off)]


def at_axis(canvas: np.ndarray, camera_from_body: np.ndarray, axis: int) -> np.ndarray:
    """Return the colours along an axis of a pose, (n, 3)."""
    points = np.zeros((2, 3))
    points[1, axis] = LENGTH_M
    start, end = synthetic.project(points, camera_from_body)
    x, y = (SCALE * (start + SHARES[:, None] * (end - start))).astype(int).T
    return canvas[y, x]


def share_of(canvas: np.ndarray, camera_from_body: np.ndarray, axis: int, name: str) -> float:
    return float(np.mean(np.all(at_axis(canvas, camera_from_body, axis) == colours()[name], axis=1)))


def test_both_poses_are_drawn_where_they_are(case):
    """Expected: the true axes in their colours, those of the estimate white on the four fifths that dashes
    with round ends leave.

    Control: the bare frame has none of these colours.
    """
    markup = pose_figure(case, {"frontal": moved(turn_deg=80), "mine": ESTIMATE}, RESULT)
    canvas = drawn(markup, case.image)
    bare = drawn('<svg viewBox="0 0 128 96"></svg>', case.image)
    for axis, name in enumerate("xyz"):
        # the other pose and the other axes may cross it
        assert share_of(canvas, TRUTH, axis, name) > 0.8, name
        assert 0.65 < share_of(canvas, ESTIMATE, axis, "guess") < 0.95, name
        assert share_of(bare, TRUTH, axis, name) == share_of(bare, ESTIMATE, axis, "guess") == 0
    assert markup.count('class="guess"') == 3
    assert markup.count('class="corner"') == 8


def test_an_estimate_that_is_right_lies_in_the_true_axes(case):
    canvas = drawn(pose_figure(case, {"mine": TRUTH}, RESULT), case.image)
    for axis, name in enumerate("xyz"):
        white = share_of(canvas, TRUTH, axis, "guess")
        assert 0.65 < white < 0.95
        assert share_of(canvas, TRUTH, axis, name) == pytest.approx(1 - white, abs=0.1)


def test_control_shifted_poses_move_their_lines(case):
    """By 4 cm, 7 px: neither pose is found at its place any more, but where it was shifted to."""
    shifted = moved((-0.1, 0.06, 0), 40)
    canvas = drawn(pose_figure(case, {"mine": shifted}, RESULT), case.image)
    elsewhere = moved((0.04, 0.04, 0))
    case.truth.__dict__["camera_from_body"] = elsewhere
    other = drawn(pose_figure(case, {"mine": ESTIMATE}, RESULT), case.image)
    for axis, name in enumerate("xyz"):
        assert share_of(canvas, ESTIMATE, axis, "guess") < 0.2
        assert share_of(canvas, shifted, axis, "guess") > 0.4
        assert share_of(other, TRUTH, axis, name) < 0.2
        assert share_of(other, elsewhere, axis, name) > 0.8


def words(markup: str) -> str:
    """Return alternative text and caption."""
    (alternative,), (caption,) = (re.findall(pattern, markup) for pattern in ('alt="(.*?)"', "<figcaption>(.*?)<"))
    return f"{alternative}. {caption}"


def test_the_caption_speaks_of_what_is_drawn(case):
    markup = pose_figure(case, {"frontal": ESTIMATE, "other": None, "mine": ESTIMATE}, RESULT)
    assert "with the true and the estimated axes" in words(markup)
    assert "Wide coloured axes: truth (x red, y green, z blue, 0.2 m). Dashed white: mine. Rings: the 8" in words(
        markup
    )


@pytest.mark.parametrize(
    ("poses", "said"),
    [
        ({"frontal": ESTIMATE, "mine": None, "oracle_corners": TRUTH}, "No solver found a pose."),
        ({"mine": moved(OUTSIDE)}, "The axes that solvers found are not in the picture."),
        ({"mine": moved(BEHIND)}, "The axes that solvers found are not in the picture."),
        ({}, "z blue, 0.2 m). Rings"),
    ],
    ids=["none found", "outside", "behind the camera", "none was run"],
)
def test_without_an_estimate_in_the_picture_none_is_spoken_of(case, poses, said):
    markup = pose_figure(case, poses, RESULT)
    assert 'class="guess"' not in markup
    assert said in words(markup)
    assert "ashed" not in words(markup) and "estimated" not in words(markup)
    assert "with the true axes" in words(markup)


def test_the_next_solver_is_shown_where_the_first_is_out_of_the_picture(case):
    markup = pose_figure(case, {"far": moved(OUTSIDE), "near": ESTIMATE}, RESULT)
    assert "Dashed white: near." in words(markup)
    assert markup.count('class="guess"') == 3


def test_true_axes_and_corners_that_are_not_there_are_not_spoken_of(case):
    case.truth.__dict__["camera_from_body"] = moved(OUTSIDE)
    detected = case.truth.detected
    case.truth.__dict__["kept"] = {key: nothing(detected) for key in case.truth.kept}
    markup = pose_figure(case, {"mine": ESTIMATE}, RESULT)
    assert 'class="x"' not in markup and 'class="corner"' not in markup
    assert "The true axes are not in the picture. Dashed white: mine. No corner was detected." in words(markup)
    assert "coloured" not in words(markup) and "with the estimated axes" in words(markup)


def nothing(points):
    return replace(
        points, body_m=points.body_m[:0], image_px=points.image_px[:0], true_px=points.true_px[:0],
        covariance_px2=points.covariance_px2[:0],
    )  # fmt: skip
