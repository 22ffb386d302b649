"""`uwsim export`: one line and exit code, whole silhouettes against projected corners."""

import json
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.unit import synthetic
from uwsim.camera.lens import lens_from_record
from uwsim.dataset import store
from uwsim.dataset.generate import generate
from uwsim.dataset.recipe import load_recipe
from uwsim.dataset.silhouettes import silhouettes

SCENE = """
name = "cards"
description = "A card before another, which the picture's edge cuts off too"
[water]
name = "tank_clear"
[rig]
position_m = [0.0, 0.0, -1.0]
look_at_m = [0.0, 1.0, -1.0]
[rig.camera]
width_px = 40
height_px = 30
horizontal_fov_deg = 50.0
{camera}
[[rig.lamps]]
name = "led"
position_m = [0.0, -0.1, 0.0]
look_at_m = [0.0, 0.0, 1.0]
radiant_flux_w = 10.0
half_angle_deg = 35.0
[exposure]
time_s = 0.004
[[bodies]]
name = "near"
kind = "rectangle"
width_m = 0.30
height_m = 0.20
reflectance = 0.5
position_m = [0.0, 0.8, -1.05]
towards_m = [0.1, 0.0, -1.0]
rotation_deg = [0.0, 0.0, 20.0]
[[bodies]]
name = "far"
kind = "rectangle"
width_m = 0.60
height_m = 0.40
reflectance = 0.3
position_m = [-0.35, 1.1, -0.95]
towards_m = [0.0, 0.0, -1.0]
"""
RECIPE = """
name = "cards"
description = "one frame"
seed = 3
samples_per_pixel = 4
batches = 2
[[group]]
name = "cards"
scene = "cards.toml"
frames = 1
"""
PORT = 'distortion = [-0.05, 0.0, 0.0, 0.0]\nport = { kind = "flat", gap_m = 0.01, thickness_m = 0.005 }'


def uwsim(*arguments) -> subprocess.CompletedProcess:
    command = [sys.executable, "-m", "uwsim.cli", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300)


def test_pairs_by_command(tmp_path):
    synthetic.write_dataset(tmp_path / "data", (0, 1))
    answer = uwsim("export", tmp_path / "data", "--format", "pairs", "--out", tmp_path / "pairs")
    assert (answer.returncode, answer.stderr) == (0, "")
    assert answer.stdout == f"{tmp_path / 'pairs'}: 2 pairs\n"


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--format", "yolo"], "formats: got 'yolo', allowed: bop"),
        (["--format", "euroc"], "single frames without times"),
        (["--format", "coco", "--split", "train=0.9"], "--split: got 'train=0.9'"),
        (["--format", "coco", "--split", "train=0.5,test=0.5"], "got 2 splits for 1 scene"),
        (["--format", "coco", "--silhouettes"], "--silhouettes: got format coco"),
        (["--format", "bop", "--silhouettes"], "dataset.json"),
    ],
)
def test_bad_input_is_one_line_and_nothing_written(tmp_path, options, says):
    synthetic.write_dataset(tmp_path / "data", (0,))
    answer = uwsim("export", tmp_path / "data", "--out", tmp_path / "out", *options)
    assert (answer.returncode, answer.stdout) == (2, "")
    assert says in answer.stderr and answer.stderr.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["data"]


def generated(folder: Path, scene: str) -> store.Dataset:
    from uwsim.render import variants

    variants.use()
    (folder / "cards.toml").write_text(scene)
    (folder / "recipe.toml").write_text(RECIPE.replace("cards.toml", str(folder / "cards.toml")))
    recipe, where = load_recipe(str(folder / "recipe.toml"))
    return generate(recipe, folder / "data", where=where, resume=False)


@pytest.fixture(scope="module", params=["", PORT], ids=["pinhole", "port"])
def cards(request, tmp_path_factory) -> store.Dataset:
    return generated(tmp_path_factory.mktemp("cards"), SCENE.replace("{camera}", request.param))


def outline_px(frame, body, *, width_m: float, height_m: float) -> np.ndarray:
    """Return the projected edge of a rectangle, many points to a side because a port bends straight lines."""
    steps = np.linspace(-0.5, 0.5, 200)
    x = np.concatenate([steps, np.full(200, 0.5), -steps, np.full(200, -0.5)])
    y = np.concatenate([np.full(200, -0.5), steps, np.full(200, 0.5), -steps])
    points = np.column_stack([x * width_m, y * height_m, np.zeros_like(x), np.ones_like(x)])
    camera = points @ (np.linalg.inv(frame.world_from_camera) @ np.array(body.world_from_body)).T
    return lens_from_record(frame.info.camera.model_dump()).project(camera[:, :3])[0]


def inside(outline: np.ndarray, *, width: int, height: int) -> np.ndarray:
    """Return the signed distance of pixel centres to the outline on the canvas of 3 x 3 pictures, (3 H, 3 W) [px]."""
    shifted = (outline + [width, height]).astype(np.float32).reshape(-1, 1, 2)
    centres = np.stack(np.meshgrid(np.arange(3 * width) + 0.5, np.arange(3 * height) + 0.5), axis=-1)
    distances = [cv2.pointPolygonTest(shifted, tuple(map(float, p)), True) for p in centres.reshape(-1, 2)]
    return np.array(distances).reshape(3 * height, 3 * width)


def test_silhouettes_are_the_projected_outlines(cards, tmp_path):
    """Every pixel centre more than 0.01 px off the outline is on its right side, hidden and cut off parts included."""
    frame = cards.frame("000000")
    found = silhouettes(cards)(frame)
    sizes = {"near": (0.30, 0.20), "far": (0.60, 0.40)}
    for body in frame.info.bodies:
        width_m, height_m = sizes[body.name]
        outline = outline_px(frame, body, width_m=width_m, height_m=height_m)
        distance_px = inside(outline, width=40, height=30)
        clear = np.abs(distance_px) > 0.01
        assert np.array_equal(found[body.instance][clear], distance_px[clear] > 0)
        assert np.sum(clear) > 0.99 * clear.size


def test_visible_fractions_of_the_export(cards, tmp_path):
    answer = uwsim("export", cards.folder, "--format", "bop", "--out", tmp_path / "bop", "--silhouettes")
    assert answer.returncode == 0, answer.stderr
    scene, frame = tmp_path / "bop/train/000001", cards.frame("000000")
    info, gt = (json.loads((scene / f"{name}.json").read_text())["0"] for name in ("scene_gt_info", "scene_gt"))
    whole = silhouettes(cards)(frame)
    by_name = {body.name: body.instance for body in frame.info.bodies}
    for number, (entry, pose) in enumerate(zip(info, gt, strict=True)):
        canvas = whole[by_name[pose["uwsim_body"]]]
        seen = frame.buffer("instance") == by_name[pose["uwsim_body"]]
        assert entry["px_count_all"] == canvas.sum() and entry["px_count_visib"] == seen.sum()
        assert entry["visib_fract"] == pytest.approx(seen.sum() / canvas.sum())
        rows, columns = np.nonzero(canvas)
        assert entry["bbox_obj"][:2] == [columns.min() - 40, rows.min() - 30]
        stored = cv2.imread(str(scene / f"mask/000000_{number:06d}.png"), cv2.IMREAD_UNCHANGED) == 255
        assert np.array_equal(stored, canvas[30:60, 40:80]) and np.all(stored[seen])
    near, far = (entry["visib_fract"] for entry in info)
    assert near == 1 and far < 0.9  # hidden in part, and cut off by the edge
    assert info[1]["bbox_obj"][0] < 0


def test_rows_of_a_rolling_shutter_keep_their_times_on_the_wider_canvas(tmp_path):
    """Alone and inside the picture, a body's silhouette is what is seen of it; with another readout it is not."""
    scene = SCENE.replace("{camera}", "").replace("time_s = 0.004", "time_s = 0.004\nreadout_s = 0.02")
    alone = scene[: scene.rindex("[[bodies]]")].replace("width_m = 0.30", "width_m = 0.15")
    dataset = generated(tmp_path, alone + "[rig.motion]\nvelocity_m_per_s = [5.0, 0.0, 0.0]\n")
    seen = dataset.frame("000000").buffer("instance") == 1
    whole = silhouettes(dataset)(dataset.frame("000000"))[1]
    assert np.array_equal(whole[30:60, 40:80], seen) and whole.sum() == seen.sum() > 20
    skew = [np.nonzero(row)[0].mean() for row in seen if row.any()]
    assert abs(skew[-1] - skew[0]) > 1  # the rows do see it at different places


def test_control_a_changed_scene_is_refused(cards, tmp_path):
    path = cards.folder.parent / "cards.toml"
    text = path.read_text()
    path.write_text(text.replace("width_m = 0.30", "width_m = 0.31"))
    try:
        with pytest.raises(ValueError, match="are not those of the dataset"):
            silhouettes(cards)
    finally:
        path.write_text(text)
