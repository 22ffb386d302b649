"""The sensor as a scene describes it, auto-exposure, and raw pictures in a dataset."""

import numpy as np
import pytest

from tests.physics import scenes
from tests.unit import synthetic
from uwsim import images
from uwsim.bench.task import linear_buffer, sensor_keywords
from uwsim.camera import auto_exposure, sensor, sensor_record
from uwsim.dataset.check import check_frame
from uwsim.dataset.frame import RAW, read_frame, write_frame
from uwsim.dataset.parts import Vignetting
from uwsim.scene import truth
from uwsim.scene.models import Scene
from uwsim.validation import validated

HIGHLIGHT = 50.0  # times the rest of the picture


def scene(*, exposure=None, motion=None, **chosen) -> Scene:
    values = scenes.wall(distance_m=1.0).model_dump()
    values["sensor"] = {"white_balance": (1.5, 1.0, 2.0)} | chosen
    values["rig"]["camera"] |= {"width_px": 40, "height_px": 30, "horizontal_fov_deg": 60.0}
    values["exposure"] |= {"time_s": 0.01} | (exposure or {})
    values["rig"]["motion"] = motion
    return validated(Scene, values, where="scene.toml")


def picture(made: Scene, level: float) -> np.ndarray:
    """Return radiance whose mean over the bands is around `level` of white, with a lamp in view."""
    constants = sensor.Constants(**truth.sensor_constants(made))
    camera = made.rig.camera
    shade = np.linspace(0.5, 1.5, camera.height_px * camera.width_px).reshape(camera.height_px, camera.width_px, 1)
    shade[0, :2] = HIGHLIGHT
    return level * shade / constants.linear_per_radiance


def test_a_plain_scene_has_the_plain_sensor():
    constants = truth.sensor_constants(scene())
    assert (constants["gain"], constants["adc_bits"], constants["dark_e"]) == (1.0, None, 0.0)
    assert constants["relative_illumination"] is constants["mosaic"] is None


def test_dark_current_grows_with_the_exposure_time_in_mean_and_variance():
    for time_s in (0.1, 0.5, 1.0):
        made = scene(exposure={"time_s": time_s}, dark_current_e_per_s=2000.0, read_noise_e=5.0, adc_bits=14)
        constants = truth.sensor_constants(made)
        gain = sensor.Constants(**constants).gain_dn_per_e
        dn = sensor.raw_dn(np.zeros((150, 150, 3)), rng=np.random.default_rng(0), **constants).astype(float)
        error = np.sqrt((2000 * time_s + 25) / dn.size)
        assert dn.mean() / gain == pytest.approx(2000 * time_s, abs=4 * error)
        assert dn.var() / gain**2 == pytest.approx(2000 * time_s + 25, rel=4 * np.sqrt(2 / dn.size))


def test_the_system_gain_given_is_the_one_used():
    made = scene(adc_bits=12, black_level_dn=100, gain_dn_per_e=1.25)
    constants = sensor.Constants(**truth.sensor_constants(made))
    assert constants.gain_dn_per_e == pytest.approx(1.25)
    assert constants.saturation_e == pytest.approx((4095 - 100) / 1.25)


@pytest.mark.parametrize(
    ("chosen", "message"),
    [
        ({"adc_bits": 11}, "sensor.adc_bits: got 11, allowed: 8, 10, 12, 14 or 16"),
        ({"adc_bits": 12, "black_level_dn": -1}, "sensor.black_level_dn: got -1, allowed: >= 0"),
        ({"adc_bits": 8, "black_level_dn": 255}, "sensor.black_level_dn: got 255, allowed: < 255 at 8 bits"),
        ({"black_level_dn": 4}, "black_level_dn = 4 needs adc_bits"),
        ({"raw": True}, "raw = True needs adc_bits"),
        ({"mosaic": "RGGB"}, "mosaic = RGGB needs adc_bits"),
        ({"mosaic": "RGB", "adc_bits": 12}, "sensor.mosaic: got 'RGB', allowed: 'RGGB', 'BGGR', 'GRBG' or 'GBRG'"),
        ({"mosaic": "RGGB", "adc_bits": 12, "demosaic": "vng"}, "'vng' with adc_bits = 12, allowed: 8"),
        ({"adc_bits": 12, "gain": 2.0, "gain_dn_per_e": 1.0}, "gain and gain_dn_per_e are both given"),
        ({"full_well_e": 0.0}, "sensor.full_well_e: got 0.0, allowed: > 0"),
        ({"prnu": 0.5}, "sensor.prnu: got 0.5, allowed: <= 0.1"),
        ({"vignetting": {"cos": True}}, "sensor.vignetting.cos: unknown key, allowed: cos4, polynomial"),
        ({"exposure": {"auto": {"adjust": "iso", "target": 0.4}}}, "auto.adjust: got 'iso', allowed: 'time', 'gain'"),
        ({"exposure": {"auto": {"adjust": "gain", "target": 1.0}}}, "target: got 1.0, allowed: < 1"),
    ],
)  # fmt: skip
def test_refused_when_the_scene_is_read(chosen, message):
    with pytest.raises(ValueError, match=message) as caught:
        scene(**chosen)
    assert "\n" not in str(caught.value) and "scene.toml" in str(caught.value)


@pytest.mark.parametrize(
    ("chosen", "message"),
    [
        ({"dark_current_e_per_s": 2e6}, "the dark current makes 20000 e- in the exposure"),
        ({"vignetting": {"polynomial": (-50.0,)}}, "vignetting: polynomial .* allowed: > 0 in the whole image"),
        ({"adc_bits": None, "gain": 0.5}, "a gain below 1 need adc_bits"),
    ],
)
def test_refused_before_rendering(chosen, message):
    with pytest.raises(ValueError, match=message):
        truth.sensor_constants(scene(**chosen))


@pytest.mark.parametrize("percentile", [None, 50.0, 90.0])
@pytest.mark.parametrize("dark", [0.0, 1e5])
@pytest.mark.parametrize(
    ("adjust", "level"), [("gain", 0.05), ("gain", 0.2), ("time", 0.01), ("time", 0.1), ("time", 5.0)]
)
def test_auto_exposure_meets_its_target(adjust, level, dark, percentile):
    """With a highlight that is clipped, and with dark current: the mean or percentile of the picture is the target."""
    made = scene(
        exposure={"auto": {"adjust": adjust, "target": 0.4, "percentile": percentile}}, dark_current_e_per_s=dark
    )
    radiance = picture(made, level)
    exposed, reached = truth.auto_exposed(made, radiance)
    linear = sensor.linear_from_radiance(radiance, **truth.sensor_constants(exposed))
    bright = np.minimum(linear.mean(axis=-1), 1)
    assert (bright.mean() if percentile is None else np.percentile(bright, percentile)) == pytest.approx(0.4, rel=1e-5)
    assert reached == pytest.approx(0.4, rel=1e-5)
    if adjust == "gain":
        assert exposed.exposure.time_s == 0.01 and exposed.sensor.relative_gain > 1
    else:
        assert exposed.sensor == made.sensor and (exposed.exposure.time_s < 0.01) == (level > 1)


def test_a_clipped_highlight_counts_as_white_and_no_more():
    """Control: metered without clipping, the lamp in view would take all the brightness there is."""
    made = scene(exposure={"auto": {"adjust": "time", "target": 0.4}})
    radiance = picture(made, 0.02)
    exposed, _ = truth.auto_exposed(made, radiance)
    linear = sensor.linear_from_radiance(radiance, **truth.sensor_constants(exposed))
    assert linear.mean() > 0.41


@pytest.mark.parametrize(
    ("auto", "level", "found"),
    [
        ({"adjust": "gain", "most_gain": 4.0}, 0.001, ("gain", 4.0)),
        ({"adjust": "gain"}, 5.0, ("gain", 1.0)),
        ({"adjust": "time", "most_time_s": 0.02}, 0.001, ("time_s", 0.02)),
        ({"adjust": "time", "least_time_s": 0.005}, 5.0, ("time_s", 0.005)),
        ({"adjust": "time", "most_time_s": 0.02}, 0.0, ("time_s", 0.02)),
        ({"adjust": "gain", "percentile": 90.0}, 0.0, ("gain", 16.0)),
    ],
)
def test_auto_exposure_stops_at_its_limits_and_says_what_it_reached(auto, level, found):
    made = scene(exposure={"auto": {"target": 0.4} | auto})
    exposed, reached = truth.auto_exposed(made, picture(made, level))
    key, value = found
    assert getattr(exposed.sensor if key == "gain" else exposed.exposure, key) == value
    assert reached != pytest.approx(0.4, rel=0.01)


def test_without_auto_exposure_the_scene_stays():
    made = scene()
    assert truth.auto_exposed(made, picture(made, 0.1)) == (made, None)
    with pytest.raises(ValueError, match="target = 1, allowed: above 0 and below 1"):
        auto_exposure.brightness_factor(np.ones((2, 2, 3)), target=1, percentile=None)


def test_the_time_of_a_moving_rig_is_not_adjusted():
    motion = {"velocity_m_per_s": (1.0, 0.0, 0.0)}
    truth.sensor_constants(scene(motion=motion, exposure={"auto": {"adjust": "gain", "target": 0.4}}))
    with pytest.raises(ValueError, match="exposure.auto.adjust = 'time' with a rig in motion, allowed: 'gain'"):
        truth.sensor_constants(scene(motion=motion, exposure={"auto": {"adjust": "time", "target": 0.4}}))


def raw_frame(folder, **changes):
    """Write frame 000000 of the synthetic dataset as a camera with ADC and mosaic stores it; return it."""
    plain = synthetic.write_dataset(folder / "plain", (0,)).frame("000000")
    entry = plain.info.sensor.model_copy(
        update={"adc_bits": 12, "black_level_dn": 64, "mosaic": "GRBG", "raw": True, "dark_e": 30.0, **changes}
    )
    info = plain.info.model_copy(update={"sensor": entry})
    size = {"width_px": synthetic.WIDTH_PX, "height_px": synthetic.HEIGHT_PX}
    constants = sensor_record.constants(info.sensor.model_dump(), K=plain.K, **size)
    dn = sensor.raw_dn(plain.buffer("radiance"), rng=np.random.default_rng(entry.seed), **constants)
    buffers = {name: plain.buffer(name) for name in plain.buffer_names}
    target = folder / "000000"
    write_frame(target, image=sensor.picture_from_dn(dn, **constants), raw=dn, buffers=buffers, info=info)
    return read_frame(target)


@pytest.mark.parametrize(
    "changes", [{}, {"mosaic": None}, {"vignetting": Vignetting(cos4=True, polynomial=(-0.1,)), "gain": 2.0}]
)
def test_a_raw_picture_is_written_read_and_belongs_to_the_image(tmp_path, changes):
    frame = raw_frame(tmp_path, **changes)
    check_frame(frame)
    size = (synthetic.HEIGHT_PX, synthetic.WIDTH_PX)
    assert frame.raw.shape == ((*size, 3) if "mosaic" in changes else size)
    assert frame.raw.dtype == np.uint16 and 64 <= np.median(frame.raw) <= 4095
    # the truth in the picture's units lies on the picture
    linear = images.linear_from_srgb_uint8(frame.image)
    assert linear.mean() == pytest.approx(np.clip(linear_buffer(frame, "radiance"), 0, 1).mean(), rel=0.02)
    assert (sensor_keywords(frame)["relative_illumination"] is None) == ("vignetting" not in changes)


def test_a_raw_picture_that_does_not_belong_is_found(tmp_path):
    frame = raw_frame(tmp_path)
    images.write_png(frame.folder / RAW, frame.raw[:, ::-1])
    with pytest.raises(ValueError, match="raw16.png does not make image.png"):
        check_frame(read_frame(frame.folder))
    images.write_png(frame.folder / RAW, frame.raw[::2])
    with pytest.raises(ValueError, match=r"raw16.png is \(48, 128\), allowed: \(96, 128\)"):
        check_frame(read_frame(frame.folder))
    images.write_png(frame.folder / RAW, (frame.raw // 16).astype(np.uint8))
    with pytest.raises(ValueError, match="raw16.png: not a 16-bit PNG"):
        check_frame(read_frame(frame.folder))
    (frame.folder / RAW).unlink()
    with pytest.raises(ValueError, match="raw16.png is missing"):
        check_frame(read_frame(frame.folder))


def test_raw_pictures_are_written_where_asked_for_only(tmp_path):
    frame = raw_frame(tmp_path)
    buffers = {name: frame.buffer(name) for name in frame.buffer_names}
    with pytest.raises(ValueError, match="raw picture not given, sensor.raw = True"):
        write_frame(tmp_path / "other", image=frame.image, buffers=buffers, info=frame.info)
    plain = read_frame(tmp_path / "plain/frames/000000")
    with pytest.raises(ValueError, match="no raw16.png; a scene asks for it with sensor.raw = true"):
        _ = plain.raw
    images.write_png(plain.folder / RAW, frame.raw)
    with pytest.raises(ValueError, match="raw16.png is there, but sensor.raw is false"):
        check_frame(plain)
