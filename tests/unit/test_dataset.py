"""Datasets on disk: what is written is read, and `check` finds what was planted."""

import shutil

import numpy as np
import pytest

import uwsim.dataset
from tests.unit import synthetic
from uwsim.dataset import exr, store
from uwsim.dataset.check import check, check_frame
from uwsim.dataset.frame import BUFFERS, FILES, ORDERS, check_buffers, read_frame, write_frame
from uwsim.scene import truth
from uwsim.scene.load import scene_values
from uwsim.scene.models import Scene

SHAPE = (6, 5)


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    return synthetic.write_dataset(tmp_path_factory.mktemp("data") / "sound", (0, 2))


@pytest.mark.parametrize("channels", [1, 2, 3])
@pytest.mark.parametrize(("kind", "dtype"), [("half", np.float16), ("float", np.float32), ("uint", np.uint32)])
def test_exr_there_and_back(tmp_path, kind, dtype, channels):
    shape = SHAPE if channels == 1 else (*SHAPE, channels)
    image = (np.random.default_rng(0).random(shape) * 1000).astype(dtype)
    exr.write(tmp_path / "a.exr", {"one": (image, kind), "two": (image[::-1], kind)})
    parts = exr.read(tmp_path / "a.exr")
    assert list(parts) == ["one", "two"]
    assert np.array_equal(parts["one"], image) and np.array_equal(parts["two"], image[::-1])
    assert parts["one"].dtype == (np.uint32 if kind == "uint" else np.float32)
    assert [path.name for path in tmp_path.iterdir()] == ["a.exr"]


def test_exr_keeps_infinity_and_refuses_what_half_cannot_hold(tmp_path):
    far = np.full(SHAPE, np.inf, np.float32)
    exr.write(tmp_path / "a.exr", {"range": (far, "float"), "half": (far, "half")})
    assert np.all(np.isposinf(exr.read(tmp_path / "a.exr")["range"]))
    with pytest.raises(ValueError, match="b.exr: bright exceeds the half-float range"):
        exr.write(tmp_path / "b.exr", {"bright": (np.full(SHAPE, 7e4), "half")})
    assert not (tmp_path / "b.exr").exists()


@pytest.mark.parametrize("share", [0.0, 0.001, 0.01, 0.3, 0.9, 0.99, 0.9999])
def test_a_truncated_exr_is_refused_silently_on_both_streams(sound, tmp_path, capfd, share):
    data = (sound.folder / "frames/000000/frame.exr").read_bytes()
    (tmp_path / "cut.exr").write_bytes(data[: int(share * len(data))])
    with pytest.raises(ValueError, match="cut.exr: not a readable EXR") as caught:
        exr.read(tmp_path / "cut.exr")
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


def test_exr_bytes_depend_on_the_content_alone(tmp_path):
    image = np.random.default_rng(0).random(SHAPE).astype(np.float32)
    for name in "ab":
        exr.write(tmp_path / f"{name}.exr", {"image": (image, "float")})
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()


def test_a_frame_there_and_back(sound, tmp_path):
    frame = sound.frame("000002")
    buffers = {name: frame.buffer(name) for name in frame.buffer_names}
    assert set(buffers) == set(BUFFERS) - set(ORDERS)
    write_frame(tmp_path / "000002", image=frame.image, buffers=buffers, info=frame.info)
    again = read_frame(tmp_path / "000002")
    assert again.info == frame.info and np.array_equal(again.image, frame.image)
    assert all(np.array_equal(again.buffer(name), buffers[name]) for name in buffers)
    assert {path.name for path in again.folder.iterdir()} == set(FILES)
    with pytest.raises(ValueError, match="no buffer 'depth'; it has radiance, direct"):
        again.buffer("depth")


def test_layers_by_order_are_there_if_and_only_if_the_options_say_so(sound, tmp_path):
    frame = sound.frame("000002")
    buffers = {name: frame.buffer(name) for name in frame.buffer_names}
    shares = {"direct_unscattered": buffers["direct"], "backscatter_single": 0.5 * buffers["backscatter"]}
    asked = frame.info.model_copy(update={"options": frame.info.options.model_copy(update={"orders": True})})
    write_frame(tmp_path / "000002", image=frame.image, buffers=buffers | shares, info=asked)
    check_frame(read_frame(tmp_path / "000002"))
    for name, given, info in (("a", buffers | shares, frame.info), ("b", buffers, asked)):
        with pytest.raises(ValueError, match="backscatter_single is .*options.orders"):
            write_frame(tmp_path / name, image=frame.image, buffers=given, info=info)
    too_much = buffers | shares | {"backscatter_single": 1.1 * buffers["backscatter"]}
    write_frame(tmp_path / "more" / "000002", image=frame.image, buffers=too_much, info=asked)
    with pytest.raises(ValueError, match="more than backscatter"):
        check_frame(read_frame(tmp_path / "more" / "000002"))
    with pytest.raises(ValueError, match="belong together"):
        type(frame.info.options).model_validate({"denoiser": "some", "denoised_layers": ("backscatter",)})


def test_water_has_bands_without_lamps():
    """Daylight weights them then; green water is clearest where its light is strongest."""
    values, _ = scene_values("tank_usaf")
    lit = truth.water_bands(Scene.model_validate(values))
    values["rig"]["lamps"] = []
    values["daylight"] = {"sky_irradiance_w_per_m2": 100.0}
    day = truth.water_bands(Scene.model_validate(values))
    assert (lit["weighting"], day["weighting"]) == (
        "camera response x lamp spectrum", "camera response x daylight spectrum"
    )  # fmt: skip
    np.testing.assert_allclose(day["attenuation_per_m"], lit["attenuation_per_m"], rtol=0.1)
    assert day["attenuation_per_m"] != lit["attenuation_per_m"]


def test_a_frame_that_is_refused_leaves_nothing(sound, tmp_path):
    frame = sound.frame("000000")
    buffers = {name: frame.buffer(name) for name in frame.buffer_names}
    broken = {
        "missing": {name: image for name, image in buffers.items() if name != "albedo"},
        "unknown": buffers | {"depth": buffers["range"]},
        "shape": buffers | {"albedo": buffers["albedo"][1:]},
        "non-finite": buffers | {"albedo": np.full_like(buffers["albedo"], np.nan)},
        "sharp": buffers | {"sharp": buffers["radiance"]},  # without the flow
    }
    for message, wrong in broken.items():
        with pytest.raises(ValueError, match=message if message != "sharp" else "missing.*flow_end"):
            write_frame(tmp_path / "000000", image=frame.image, buffers=wrong, info=frame.info)
    assert list(tmp_path.iterdir()) == []


def test_only_distances_may_be_infinite(sound):
    frame = sound.frame("000000")
    buffers = {name: frame.buffer(name).copy() for name in frame.buffer_names}
    size = {"height": synthetic.HEIGHT_PX, "width": synthetic.WIDTH_PX}
    buffers["range"][0, 0] = buffers["z_depth"][0, 0] = np.inf
    check_buffers(buffers, **size)
    buffers["range"][0, 0] = -np.inf
    with pytest.raises(ValueError, match="range holds 1 non-finite"):
        check_buffers(buffers, **size)


def test_open_reads_a_dataset_in_order(sound):
    dataset = uwsim.dataset.open(sound.folder)
    assert (dataset.name, len(dataset), dataset.frame_names) == ("synthetic", 2, ("000000", "000002"))
    assert [frame.name for frame in dataset.frames] == ["000000", "000002"]
    assert [frame.info.blur is None for frame in dataset.frames] == [True, False]
    assert pytest.approx(synthetic.K) == dataset.frame("000000").K
    assert dataset.frame("000000").world_from_camera == pytest.approx(synthetic.world_from_camera())
    assert set(dataset.manifest["files"]) == {f"frames/{name}/{file}" for name in dataset.frame_names for file in FILES}


def test_control_the_sound_dataset_passes(sound):
    seen = []
    assert check(sound.folder, progress=lambda done, total: seen.append((done, total))) == 2
    assert seen == [(1, 2), (2, 2)]


def rewritten(sound: store.Dataset, folder, change, *, image=None, **info) -> store.Dataset:
    """Return a copy whose frame 000000 was changed and entered with its new checksums."""
    shutil.copytree(sound.folder, folder)
    frame = read_frame(folder / "frames/000000")
    buffers = {name: frame.buffer(name).copy() for name in frame.buffer_names}
    picture = frame.image if image is None else image
    change(buffers)
    shutil.rmtree(frame.folder)
    write_frame(frame.folder, image=picture, buffers=buffers, info=frame.info.model_copy(update=info))
    store.write_manifest(folder, sound.manifest | {"files": store.checksums(folder)})
    return store.open(folder)


def at_corner(name: str, value: float):
    return lambda buffers: buffers[name].__setitem__((0, 0), value)


def scaled(name: str, factor: float):
    return lambda buffers: buffers.__setitem__(name, buffers[name] * np.float32(factor))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (at_corner("range", np.inf), "range and instance disagree"),
        (at_corner("instance", 0), "range and instance disagree"),
        (at_corner("instance", 7), r"instance \[7\] is not among the bodies"),
        (at_corner("radiance", -1.0), "radiance has negative values"),
        (at_corner("water_free", -1.0), "water_free has negative values"),
        (at_corner("transmission", 1.1), "transmission exceeds 1"),
        (at_corner("albedo", 1.1), "albedo exceeds 1"),
        (at_corner("z_depth", 0.5), "z_depth does not agree with range and K"),
        (scaled("range", 1.01), "z_depth does not agree with range and K"),
        (scaled("normal", 0.9), "normals are not of unit length"),
    ],
)
def test_check_finds_truth_that_does_not_agree(sound, tmp_path, change, message):
    planted = rewritten(sound, tmp_path / "planted", change)
    with pytest.raises(ValueError, match=f"frames/000000: {message}"):
        check(planted.folder)


def test_check_finds_a_picture_or_a_name_that_does_not_agree(sound, tmp_path):
    small = np.zeros((10, 10, 3), np.uint8)
    planted = rewritten(sound, tmp_path / "small", lambda buffers: None, image=small)
    with pytest.raises(ValueError, match=r"image.png is \(10, 10\), allowed: \(96, 128\)"):
        check(planted.folder)
    planted = rewritten(sound, tmp_path / "named", lambda buffers: None, name="000001")
    with pytest.raises(ValueError, match="frame.json calls itself '000001'"):
        check(planted.folder)


def test_control_a_frame_written_again_unchanged_passes(sound, tmp_path):
    planted = rewritten(sound, tmp_path / "same", lambda buffers: None)
    assert check(planted.folder) == 2
    assert planted.manifest["files"] == sound.manifest["files"]
