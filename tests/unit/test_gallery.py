"""The gallery of a dataset: index, previews, drawings; made once, the same bytes again, and refused in one line."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import synthetic

from uwsim.camera import pose
from uwsim.camera.lens import lens_from_record
from uwsim.camera.sensor import expose_without_noise
from uwsim.dataset import store
from uwsim.dataset.check import _check_files
from uwsim.dataset.frame import BUFFERS, Frame, read_frame, write_frame
from uwsim.dataset.info import FrameInfo
from uwsim.files import sha256
from uwsim.gallery import drawings, layers, markup
from uwsim.gallery.facts import turbidity_classes
from uwsim.gallery.make import write
from uwsim.images import decode

STILL = {
    "image", "radiance", "water_free", "direct", "forward_scatter", "backscatter", "transmission", "standard_error",
    "z_depth", "range", "normal", "albedo", "instance",
}  # fmt: skip


def content(path: Path) -> dict:
    """Return the JSON inside a script of the gallery."""
    return json.loads(re.fullmatch(r"gallery\.\w+\((.*)\);\n", path.read_text(encoding="utf-8"), re.S)[1])


def checksums(folder: Path) -> dict[str, str]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): sha256(path) for path in files}


@pytest.fixture(scope="module")
def data(tmp_path_factory) -> store.Dataset:
    return synthetic.write_dataset(tmp_path_factory.mktemp("data") / "synthetic")


@pytest.fixture(scope="module")
def made(tmp_path_factory, data) -> Path:
    out = tmp_path_factory.mktemp("gallery") / "out"
    written = write(data.folder, out)
    assert (written.page, written.frames, written.made) == (out / "index.html", 4, 4)
    return out


@pytest.fixture
def copied(tmp_path, data) -> Path:
    """The dataset, to break it."""
    shutil.copytree(data.folder, tmp_path / "data")
    return tmp_path / "data"


def test_the_index_knows_every_frame_and_what_to_filter_by(made):
    index = content(made / "index.js")
    assert [frame["name"] for frame in index["frames"]] == ["000000", "000001", "000002", "000003"]
    assert index["turbidities"] == ["0.2 /m", "0.6 /m"]
    assert [frame["turbidity"] for frame in index["frames"]] == [0, 1, 0, 0]
    assert {(frame["scene"], frame["group"]) for frame in index["frames"]} == {("synthetic", "synthetic")}
    assert [frame["markers"] for frame in index["frames"]] == [0, 0, 0, 2]


def test_every_buffer_of_a_frame_has_a_layer_and_every_layer_its_picture(made, data):
    for name, more in (("000000", set()), ("000002", {"sharp", "flow"})):
        frame = content(made / "frames" / name / "frame.js")
        keys = {layer["key"] for layer in frame["layers"]}
        assert keys == STILL | more
        assert {key.replace("flow", "flow_end") for key in keys} >= set(data.frame(name).buffer_names) - {"flow_start"}
        for key in keys:
            assert decode(made / "frames" / name / f"{key}.webp", 1).shape == (96, 128, 3)
        assert frame["json"] == json.loads((data.folder / "frames" / name / "frame.json").read_text())


def test_pictures_are_those_of_the_camera_and_small_ones_are_kept_without_loss(made, data):
    frame = data.frame("000001")
    stored = decode(made / "frames/000001/image.webp", 1)[..., ::-1]
    assert np.array_equal(stored, frame.image)
    expected = expose_without_noise(frame.buffer("radiance"), **synthetic.SENSOR)
    assert np.abs(decode(made / "frames/000001/radiance.webp", 1)[..., ::-1].astype(int) - expected).max() <= 1


def test_dim_layers_are_shown_brighter_by_a_power_of_two_and_say_so(made, data):
    assert layers.gain_for(np.full((4, 4, 3), 0.01, np.float32)) == 64
    assert layers.gain_for(np.full((4, 4, 3), 0.09, np.float32)) == 8
    assert layers.gain_for(np.full((4, 4, 3), 0.5, np.float32)) == 1
    assert layers.gain_for(np.zeros((4, 4, 3), np.float32)) == 1
    by_key = {layer["key"]: layer for layer in content(made / "frames/000000/frame.js")["layers"]}
    linear = layers.linear_picture(data.frame("000000"), "backscatter")
    assert by_key["backscatter"]["gain"] == layers.gain_for(linear)
    assert by_key["water_free"]["gain"] == 1  # so that it compares with the picture


def test_a_buffer_without_words_of_its_own_is_shown_all_the_same(data):
    frame = read_frame(data.folder / "frames" / "000000")
    frame.__dict__["_buffers"] = data.frame("000000")._buffers | {"new_one": np.ones((96, 128, 2), np.float32)}
    (layer,) = (one for one in layers.layers_of(frame) if one.group == "More")
    assert (layer.key, layer.title, layer.picture.shape) == ("new_one", "new one", (96, 128, 3))


def test_flow_colours_tell_direction_and_length():
    right, up, none = layers.flow_colours(np.array([[4.0, 0.0], [0.0, -4.0], [0.0, 0.0]]), 4.0)
    assert right.tolist() == [255, 0, 0]
    assert up.tolist() == [128, 255, 0]  # a quarter of the wheel on
    assert none.tolist() == [255, 255, 255]


def test_turbidity_is_sorted_into_values_or_into_classes():
    assert turbidity_classes([3.0, 1.0, 3.0]) == (["1 /m", "3 /m"], [1, 0, 1])
    names, classes = turbidity_classes([0.01, 0.2, 0.25, 0.3, 0.31, 0.4, 0.9, 2.0, 40.0])
    assert names == ["below 0.03 /m", "0.1 to 0.3 /m", "0.3 to 1 /m", "1 to 3 /m", "30 /m and more"]
    assert classes == [0, 1, 1, 2, 2, 2, 2, 3, 4]


def test_markers_and_axes_lie_where_the_lens_sees_them(made, data):
    frame = content(made / "frames/000003/frame.js")
    corners = synthetic.project(synthetic.marker_corners_m()[3], synthetic.camera_from_board())
    (marker,) = (one for one in frame["markers"] if one["id"] == 3)
    assert np.allclose(marker["corners"], corners, atol=0.01)
    board = next(body for body in frame["bodies"] if body["name"] == "board")
    at = board["axes"]
    points = np.vstack([np.zeros(3), at["length_m"] * np.eye(3)])
    expected = synthetic.project(points, synthetic.camera_from_board())
    assert np.allclose([at["origin"], *at["ends"]], expected, atol=0.01)
    assert at["length_m"] == pytest.approx(0.05)  # the largest of 1, 2, 5 ... within a tenth of the width, 75 mm
    assert sum(body["share"] for body in frame["bodies"]) == pytest.approx(1, abs=1e-4)


SPEED_M_PER_S, EXPOSURE_S = 0.4, 0.02


def moving_frame(folder: Path, *, readout_s: float = 0.0, body_too: bool = False) -> Frame:
    """Write a frame of a wall 0.8 m ahead; the camera moves along its x, and on request the wall with it."""
    times_s = np.linspace(-0.5, 0.5, 5) * (EXPOSURE_S + readout_s)
    camera = np.tile(synthetic.world_from_camera(), (5, 1, 1))
    camera[:, 0, 3] += SPEED_M_PER_S * times_s  # world x is the camera's x
    body = np.tile(np.eye(4), (5, 1, 1))
    body[:, 0, 3] += SPEED_M_PER_S * times_s
    info = synthetic._info(2, np.array([0.4, 0.2, 0.25]), moving=True)
    info["camera"] |= {
        "times_s": times_s.tolist(), "world_from_camera_through_exposure": camera.tolist(), "readout_s": readout_s,
    }  # fmt: skip
    info["sensor"]["exposure_time_s"] = EXPOSURE_S
    if body_too:
        info["bodies"][0]["world_from_body_through_exposure"] = body.tolist()
    shape = (synthetic.HEIGHT_PX, synthetic.WIDTH_PX)
    buffers = {name: np.zeros(shape if channels == 1 else (*shape, channels)) for name, (channels, _) in BUFFERS.items()
               if name not in ("direct_unscattered", "backscatter_single")}  # fmt: skip
    y, x = np.mgrid[: shape[0], : shape[1]] + 0.5
    K = synthetic.K
    ray = np.stack([(x - K[0, 2]) / K[0, 0], (y - K[1, 2]) / K[1, 1], np.ones(shape)], axis=-1)
    buffers |= {"z_depth": np.full(shape, 0.8), "range": 0.8 * np.linalg.norm(ray, axis=-1)}
    buffers = {name: values.astype(np.float32) for name, values in buffers.items()}
    buffers["instance"] = np.ones(shape, np.uint32)
    write_frame(folder, image=np.zeros((*shape, 3), np.uint8), buffers=buffers, info=FrameInfo.model_validate(info))
    return read_frame(folder)


@pytest.mark.parametrize("readout_s", [0.0, 0.01])
def test_paths_follow_the_camera_through_the_exposure(tmp_path, readout_s):
    """A point at depth z moves by -f v t / z; how fast does not depend on the row that sees it."""
    frame = moving_frame(tmp_path / "000002", readout_s=readout_s)
    lens = lens_from_record(frame.info.camera.model_dump())
    pixels = np.array([[48, 64], [5, 100], [90, 20]])
    paths = drawings.point_paths(frame, lens, pixels)
    moved = -synthetic.K[0, 0] * SPEED_M_PER_S * np.linspace(-0.5, 0.5, 17) * EXPOSURE_S / 0.8
    expected = (pixels[:, ::-1] + 0.5)[:, None] + np.stack([moved, 0 * moved], axis=-1)
    assert np.allclose(paths, expected, atol=1e-4)
    drawn = drawings.drawings_of(frame)
    assert len(drawn["paths"]) == 63
    assert np.allclose(drawn["kernel"]["path"], np.stack([moved, 0 * moved], axis=-1), atol=1e-3)
    # control: at a velocity ten per cent higher the ends would lie elsewhere
    assert not np.allclose(paths[:, -1, 0], expected[:, -1, 0] + 0.1 * moved[-1], atol=1e-4)


def test_what_moves_with_the_camera_has_a_path_of_no_length(tmp_path):
    frame = moving_frame(tmp_path / "000002", body_too=True)
    paths = drawings.point_paths(frame, lens_from_record(frame.info.camera.model_dump()), np.array([[48, 64]]))
    assert np.allclose(paths, [64.5, 48.5], atol=1e-4)


def test_frames_at_rest_have_no_paths(made):
    frame = content(made / "frames/000000/frame.js")
    assert (frame["paths"], frame["kernel"]) == ([], None)


def test_axes_behind_the_camera_or_outside_the_picture_are_none(data):
    frame = data.frame("000000")
    lens = lens_from_record(frame.info.camera.model_dump())
    for place_m in ([0, 0, -1], [2, 0, 1]):
        assert drawings.axes(pose.from_parts(np.eye(3), np.array(place_m, float)), lens, frame, 1) is None
    found = drawings.axes(pose.from_parts(np.eye(3), np.array([0.0, 0, 1])), lens, frame, 99)
    assert found["hidden"]  # another body is seen there


def test_previews_are_made_once_and_again_when_something_changed(tmp_path, copied, made):
    out = tmp_path / "out"
    write(copied, out)
    before = checksums(out)
    assert before == checksums(made)  # the same bytes anywhere
    assert write(copied, out).made == 0
    shutil.rmtree(out / "frames/000001")  # killed
    (out / "frames/000001.partial").mkdir()
    (out / "index.html").unlink()
    (out / ".partial-1-index.html").touch()
    done = []
    written = write(copied, out, progress=lambda done_, total: done.append((done_, total)))
    assert written.made == 1
    assert done == [(3, 4), (4, 4)]
    assert checksums(out) == before
    manifest = store.read_manifest(copied)
    manifest["files"]["frames/000002/image.png"] = "1" * 64
    store.write_manifest(copied, manifest)
    assert write(copied, out).made == 1


def test_a_gallery_in_the_dataset_is_no_part_of_it(copied):
    written = write(copied)
    assert written.page == copied / "gallery/index.html"
    _check_files(store.open(copied))


def test_several_processes_make_the_same_bytes(tmp_path, data, made):
    assert write(data.folder, tmp_path / "out", processes=2).made == 4
    assert checksums(tmp_path / "out") == checksums(made)


def test_the_page_refers_to_nothing_but_its_files(made):
    text = (made / "index.html").read_text(encoding="utf-8")
    links = re.findall(r'(?:src|href)="([^"]*)"', text)
    assert all((made / link).is_file() for link in links if link != "data:,")
    style = (made / "page/style.css").read_text(encoding="utf-8")
    for file in (made / "page").iterdir():
        assert not re.search(r"https?://(?!www\.w3\.org/2000/svg)", file.read_text(encoding="utf-8"))
    assert "url(" not in style
    assert "RAMP" not in style
    assert "<b>" not in markup.page("<b>")


def broken_image(folder: Path) -> None:
    from uwsim.images import write_png

    write_png(folder / "frames/000001/image.png", np.zeros((4, 4, 3), np.uint8))


def broken_json(folder: Path) -> None:
    (folder / "frames/000001/frame.json").write_text('{"format": 1}')


def broken_exr(folder: Path) -> None:
    path = folder / "frames/000001/frame.exr"
    path.write_bytes(path.read_bytes()[:5000])


def renamed(folder: Path) -> None:
    path = folder / "frames/000001/frame.json"
    path.write_text(path.read_text().replace('"name": "000001"', '"name": "000009"'))


@pytest.mark.parametrize("processes", [1, 2])
@pytest.mark.parametrize(
    ("breaks", "message"),
    [
        (broken_image, r"000001: image.png is \(4, 4\), allowed: \(96, 128\)"),
        (broken_json, "000001/frame.json: name: missing"),
        (broken_exr, "000001/frame.exr: not a readable EXR"),
        (renamed, "000001: frame.json calls itself '000009'"),
    ],
)
def test_a_broken_frame_is_refused_in_one_line_and_no_page_is_written(tmp_path, copied, breaks, message, processes):
    breaks(copied)
    with pytest.raises(ValueError, match=message) as caught:
        write(copied, tmp_path / "out", processes=processes)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out/index.html").exists()
    assert not list((tmp_path / "out/frames").glob("*.partial"))


def missing_file(folder: Path) -> None:
    (folder / "frames/000002/frame.exr").unlink()


def unfinished(folder: Path) -> None:
    store.write_manifest(folder, store.read_manifest(folder) | {"complete": False})


def no_dataset(folder: Path) -> None:
    (folder / "dataset.json").unlink()


@pytest.mark.parametrize(
    ("breaks", "message"),
    [
        (missing_file, "file frames/000002/frame.exr is missing"),
        (unfinished, "generation is unfinished"),
        (no_dataset, "no dataset here"),
    ],
)
def test_a_broken_dataset_is_refused_before_anything_is_written(tmp_path, copied, breaks, message):
    breaks(copied)
    with pytest.raises(ValueError, match=message):
        write(copied, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_folder_that_is_no_gallery_of_this_dataset_is_left_alone(tmp_path, data, made):
    (tmp_path / "full").mkdir()
    (tmp_path / "full/letter.txt").touch()
    (tmp_path / "file").touch()
    (tmp_path / "other").mkdir()
    (tmp_path / "other/gallery.json").write_text('{"format": 1, "dataset": "another"}')
    for out, message in (
        (tmp_path / "full", "holds something else"),
        (tmp_path / "file", "is a file"),
        (tmp_path / "other", "the gallery of dataset 'another'"),
        (tmp_path / "no/where", "does not exist"),
        (data.folder, "holds something else"),
        (data.folder / "frames", "among the frames"),
        (data.folder / "frames/gallery", "among the frames"),
    ):
        before = checksums(tmp_path)
        with pytest.raises(ValueError, match=message):
            write(data.folder, out)
        assert checksums(tmp_path) == before
    with pytest.raises(ValueError, match="--workers: got 0, allowed: 1 or more"):
        write(data.folder, made, processes=0)
