"""BOP scenes: a reader written from the published format finds poses, depth, masks and corners of the frames."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.unit import synthetic
from uwsim.dataset import store
from uwsim.export.cameras import camera_points_m, pinhole_of
from uwsim.export.models import Extents
from uwsim.export.run import export

QUIET = {"shares": None, "progress": lambda *_: None}
PORT = {
    "kind": "flat", "gap_m": 0.02, "thickness_m": 0.008, "normal": [0.0, 0.0, 1.0], "n_air": 1.0, "n_glass": 1.52,
    "n_water": 1.334, "glass_absorption_per_m": 0.0,
}  # fmt: skip


def changed(dataset: store.Dataset, name: str, **camera):
    """Change the camera entry of a frame.json and return the frame."""
    path = dataset.folder / "frames" / name / "frame.json"
    info = json.loads(path.read_text())
    info["camera"] |= camera
    path.write_text(json.dumps(info))
    return dataset.frame(name)


class Bop:
    """A reader of one BOP scene, after docs/bop_datasets_format.md: millimetres, OpenCV, arrays row by row."""

    def __init__(self, scene: Path):
        self.scene = scene
        tables = ("scene_camera", "scene_gt", "scene_gt_info")
        self.camera, self.gt, self.info = (json.loads((scene / f"{name}.json").read_text()) for name in tables)

    def K(self, image: int) -> np.ndarray:
        return np.reshape(self.camera[str(image)]["cam_K"], (3, 3))

    def depth_mm(self, image: int) -> np.ndarray:
        stored = cv2.imread(str(self.scene / f"depth/{image:06d}.png"), cv2.IMREAD_UNCHANGED)
        assert stored.dtype == np.uint16
        return stored * self.camera[str(image)]["depth_scale"]

    def mask(self, image: int, number: int, kind: str = "mask_visib") -> np.ndarray:
        stored = cv2.imread(str(self.scene / f"{kind}/{image:06d}_{number:06d}.png"), cv2.IMREAD_UNCHANGED)
        assert set(np.unique(stored)) <= {0, 255}
        return stored == 255

    def project(self, image: int, number: int, points_mm: np.ndarray) -> np.ndarray:
        entry = self.gt[str(image)][number]
        camera = points_mm @ np.reshape(entry["cam_R_m2c"], (3, 3)).T + entry["cam_t_m2c"]
        pixels = camera @ self.K(image).T
        return pixels[:, :2] / pixels[:, 2:]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bop")
    dataset = synthetic.write_dataset(folder / "data")
    summary = export(dataset.folder, folder / "bop", format="bop", **QUIET)
    assert summary == "4 images in 1 scenes, 8 poses of 2 objects"
    return dataset, folder / "bop"


def test_corners_reprojected_are_the_markers_in_opencvs_pixels(made):
    dataset, folder = made
    bop, seen = Bop(folder / "train/000001"), 0
    for marker in dataset.frame("000003").info.markers:
        number = next(i for i, entry in enumerate(bop.gt["3"]) if entry["uwsim_body"] == marker.body)
        pixels = bop.project(3, number, 1e3 * np.array(marker.corners_body_m))
        np.testing.assert_allclose(pixels + 0.5, marker.corners_px, atol=1e-9)
        seen += 1
    assert seen == 2


def test_poses_depth_and_masks_are_those_of_the_frames(made):
    dataset, folder = made
    bop = Bop(folder / "train/000001")
    for frame in dataset.frames:
        image, entry = frame.info.frame, bop.camera[str(frame.info.frame)]
        camera_from_world = np.linalg.inv(frame.world_from_camera)
        np.testing.assert_allclose(np.reshape(entry["cam_R_w2c"], (3, 3)), camera_from_world[:3, :3], atol=1e-12)
        np.testing.assert_allclose(entry["cam_t_w2c"], 1e3 * camera_from_world[:3, 3], atol=1e-9)
        off_mm = np.abs(bop.depth_mm(image) - 1e3 * frame.buffer("z_depth"))
        assert entry["depth_scale"] == 0.1 and off_mm.max() <= 0.05 + 1e-3
        for number, (gt, info) in enumerate(zip(bop.gt[str(image)], bop.info[str(image)], strict=True)):
            body = next(body for body in frame.info.bodies if body.name == gt["uwsim_body"])
            mask = frame.buffer("instance") == body.instance
            assert np.array_equal(bop.mask(image, number), mask)
            assert info["px_count_visib"] == info["px_count_valid"] == mask.sum()
            rows, columns = np.nonzero(mask)
            width, height = np.ptp(columns), np.ptp(rows)
            assert info["bbox_visib"] == [columns.min(), rows.min(), width, height]
            assert "visib_fract" not in info  # what is hidden is not in a dataset
    assert not (folder / "train/000001/mask").exists()
    assert "are missing" in (folder / "dataset_info.md").read_text()


def test_points_of_depth_and_K_are_those_that_the_pixels_see(made):
    """Every pixel's point: from depth and K by the format's formula, and from range and lens by ours."""
    dataset, folder = made
    bop, frame = Bop(folder / "train/000001"), dataset.frame("000001")
    rows, columns = np.mgrid[: synthetic.HEIGHT_PX, : synthetic.WIDTH_PX]
    rays = np.stack([columns, rows, np.ones_like(rows)], axis=-1) @ np.linalg.inv(bop.K(1)).T
    np.testing.assert_allclose(rays * bop.depth_mm(1)[..., None], 1e3 * camera_points_m(frame), atol=0.06)


def test_models_info_is_the_box_of_what_is_seen(made):
    dataset, folder = made
    models = json.loads((folder / "models/models_info.json").read_text())
    assert [entry["uwsim_kind"] for entry in models.values()] == ["plane", "board"]
    points = []
    for frame in dataset.frames:
        body = frame.info.bodies[1]
        seen = camera_points_m(frame)[frame.buffer("instance") == body.instance]
        body_from_camera = np.linalg.inv(body.world_from_body) @ frame.world_from_camera
        points.append(1e3 * (seen @ body_from_camera[:3, :3].T + body_from_camera[:3, 3]))
    points = np.concatenate(points)
    entry = models["2"]
    np.testing.assert_allclose([entry[f"min_{axis}"] for axis in "xyz"], points.min(axis=0), atol=1e-9)
    np.testing.assert_allclose([entry[f"size_{axis}"] for axis in "xyz"], np.ptp(points, axis=0), atol=1e-9)
    corners = points[::37]
    apart = np.linalg.norm(corners[:, None] - corners[None], axis=-1).max()
    assert apart * 0.995 <= entry["diameter"] <= np.linalg.norm(np.ptp(points, axis=0))


def test_diameters_of_a_ball_and_of_a_box():
    rng = np.random.default_rng(0)
    ball, box = Extents(), Extents()
    points = rng.standard_normal((20_000, 3))
    ball.add(points / np.linalg.norm(points, axis=-1, keepdims=True))
    box.add(rng.random((100, 3)))
    box.add(np.array([[x, y, z] for x in (0, 1) for y in (0, 2) for z in (0, 3)], float))
    assert ball.entry_mm()["diameter"] == pytest.approx(2000, rel=5e-3)
    assert box.entry_mm()["diameter"] == pytest.approx(1e3 * np.sqrt(14), rel=1e-12)
    assert box.entry_mm()["size_z"] == 3000 and Extents().is_empty


def test_behind_a_port_K_is_the_best_pinhole_and_says_how_far_it_is_off(tmp_path):
    dataset = synthetic.write_dataset(tmp_path / "data", (0,))
    frame = changed(dataset, "000000", port=PORT)
    export(dataset.folder, tmp_path / "bop", format="bop", **QUIET)
    entry = Bop(tmp_path / "bop/train/000001").camera["0"]
    K, points = np.reshape(entry["cam_K"], (3, 3)), camera_points_m(frame)
    rows, columns = np.mgrid[: synthetic.HEIGHT_PX, : synthetic.WIDTH_PX]
    centres = np.stack([columns, rows], axis=-1)

    def rms_px(K):
        pixels = points @ K.T
        return np.sqrt(np.mean(np.sum((pixels[..., :2] / pixels[..., 2:] - centres) ** 2, axis=-1)))

    assert entry["uwsim_pinhole_rms_px"] == pytest.approx(rms_px(K), rel=1e-6)
    assert 0.05 < rms_px(K) < 1.5 < entry["uwsim_pinhole_max_px"] < 8
    assert K[0, 0] > 1.3 * 120  # water makes things larger
    # least squares: any other pinhole is worse, that of the lens in air much so
    for change in (np.diag([1.002, 1, 1]), np.diag([1, 0.998, 1])):
        assert rms_px(K) < rms_px(K @ change)
    assert rms_px(np.array([[120, 0, 63.5], [0, 120, 47.5], [0, 0, 1]])) > 5 * rms_px(K)
    assert "**It is not exact**" in (tmp_path / "bop/dataset_info.md").read_text()


def test_distortion_is_exact_where_a_format_has_it(tmp_path):
    """OpenCV's own projection of what the pixels see gives the pixels back."""
    dataset = synthetic.write_dataset(tmp_path / "data", (0,))
    frame = changed(dataset, "000000", distortion=[-0.12, 0.03, 0.001, -0.002, 0.0])
    found = pinhole_of([frame], with_distortion=True)
    assert found.is_exact and not pinhole_of([frame]).is_exact and pinhole_of([frame]).max_px > 0.5
    points = camera_points_m(frame).reshape(-1, 3)
    pixels = cv2.projectPoints(points, np.zeros(3), np.zeros(3), found.K, np.array(found.distortion))[0][:, 0]
    rows, columns = np.mgrid[: synthetic.HEIGHT_PX, : synthetic.WIDTH_PX]
    np.testing.assert_allclose(pixels, np.stack([columns, rows], axis=-1).reshape(-1, 2), atol=1e-4)
    frame = changed(dataset, "000000", distortion=[-0.12, 0.03, 0.001, -0.002, 0.01])
    assert not pinhole_of([frame], with_distortion=True).is_exact


def test_a_sequence_has_one_camera(tmp_path):
    dataset = synthetic.write_dataset(tmp_path / "data", (0, 1))
    other = changed(dataset, "000001", port=PORT)
    with pytest.raises(ValueError, match="000001: the camera differs"):
        pinhole_of([dataset.frame("000000"), other])


def test_far_depths_get_coarser_steps():
    from types import SimpleNamespace

    from uwsim.export.pictures import depth_step_m, depth_steps

    for most_m, step_m in ((6.5, 1e-4), (6.6, 2e-4), (14.0, 5e-4), (33.0, 1e-3), (500.0, 1e-2)):
        z_depth = np.array([[0.5, most_m], [np.inf, 1.0]], np.float32)
        frame = SimpleNamespace(folder="frame", buffer=lambda name, z_depth=z_depth: z_depth)
        assert depth_step_m(frame, 1e-4) == pytest.approx(step_m)
        steps = depth_steps(frame, depth_step_m(frame, 1e-4))
        assert steps[1, 0] == 0 and abs(steps[0, 1] * step_m - most_m) <= 0.51 * step_m
    with pytest.raises(ValueError, match="z_depth from 0.5 to 500 m, allowed in 16 bits"):
        depth_steps(frame, 1 / 5000)


def test_the_bop_toolkit_reads_it(made):
    inout = pytest.importorskip("bop_toolkit_lib.inout", reason="bop_toolkit_lib is not installed (not on PyPI)")
    misc = pytest.importorskip("bop_toolkit_lib.misc")
    dataset, folder = made
    scene = folder / "train/000001"
    camera = inout.load_scene_camera(str(scene / "scene_camera.json"))[3]
    marker = dataset.frame("000003").info.markers[0]
    entries = inout.load_scene_gt(str(scene / "scene_gt.json"))[3]
    entry = next(entry for entry in entries if entry["uwsim_body"] == marker.body)
    points_mm = 1e3 * np.array(marker.corners_body_m)
    pixels = misc.project_pts(points_mm, camera["cam_K"], entry["cam_R_m2c"], entry["cam_t_m2c"])
    np.testing.assert_allclose(pixels + 0.5, marker.corners_px, atol=1e-9)
    depth_mm = inout.load_depth(str(scene / "depth/000003.png")) * camera["depth_scale"]
    np.testing.assert_allclose(depth_mm, 1e3 * dataset.frame("000003").buffer("z_depth"), atol=0.06)
