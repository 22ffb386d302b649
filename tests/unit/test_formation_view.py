"""Views from frames and from arrays: lamps, water, reflectances, port, and what is refused."""

import numpy as np
import pytest

from tests.unit import formation_views as views
from uwsim.camera import pose
from uwsim.camera.flat_port import FlatPort
from uwsim.camera.lens import Lens, port_record
from uwsim.formation import records
from uwsim.formation.bands import band_values, fine
from uwsim.formation.light import Daylight
from uwsim.formation.view import albedo_of_bands, pixel_angle_rad, view_of_frame
from uwsim.optics import lamp_array, phase
from uwsim.optics.beam_profile import Beam
from uwsim.optics.natural_light import surface_transmittance
from uwsim.optics.phase_functions.fournier_forand import FournierForand
from uwsim.optics.phase_functions.petzold import petzold
from uwsim.optics.phase_functions.rayleigh import Rayleigh
from uwsim.optics.phase_functions.two_term import two_term
from uwsim.optics.sources import colorchecker, illuminant
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.optics.water import named_water
from uwsim.optics.window import DomeWindow, FlatWindow
from uwsim.optics.window_field import dome_field, exact_field

WIDTH_PX, HEIGHT_PX = 12, 8
FLAT_RECORD = {
    "kind": "flat", "air_gap_m": 0.01, "thickness_m": 0.006, "radius_m": 0.03, "n_glass": 1.52, "n_water": 1.334,
    "glass_absorption_per_m": 2.0, "calibration": "bare",
}  # fmt: skip
FLAT = FlatWindow(
    air_gap_m=0.01, thickness_m=0.006, n_glass=1.52, n_water=1.334, radius_m=0.03, glass_absorption_per_m=2.0
)
DOME_RECORD = {
    "kind": "dome", "inner_radius_m": 0.02, "thickness_m": 0.004, "half_aperture_deg": 80.0, "n_glass": 1.52,
    "n_water": 1.334, "glass_absorption_per_m": 1.0, "calibration": "through_window",
}  # fmt: skip
WORLD_FROM_LAMP = pose.looking_at((0.0, 0.0, -1.0), (1.0, 0.3, -1.2), roll_deg=20.0)


def lamp_record(**changes) -> dict:
    return {
        "name": "led", "position_m": WORLD_FROM_LAMP[:3, 3].tolist(), "direction": WORLD_FROM_LAMP[:3, 2].tolist(),
        "world_from_lamp": WORLD_FROM_LAMP.tolist(), "radiant_intensity_w_per_sr": 3.0, "half_angle_deg": 40.0,
        "relative_spectrum_per_nm": illuminant("LED-B3").tolist(), "beam_angles_deg": None, "beam_values": None,
    } | changes  # fmt: skip


def frame(*, lamp=None, port=None, bands=(0.4, 0.4, 0.4), **camera) -> tuple[dict, dict]:
    """Return what a frame.json and its buffers hold: a wall at 2 m, of one reflectance."""
    water = named_water("tank_low")
    info = {
        "camera": {
            "width_px": WIDTH_PX, "height_px": HEIGHT_PX, "K": [[15.0, 0, 6.0], [0, 15.0, 4.0], [0, 0, 1]],
            "distortion": (), "port": port, "response": "Nikon 5100 (NPL)", "readout_s": 0.0,
            "world_from_camera": pose.looking_at((0, 0, -1), (1, 0, -1)).tolist(),
        }
        | camera,
        "lamps": [lamp or lamp_record()],
        "water": {
            "name": water.name, "wavelengths_nm": WAVELENGTHS_NM.tolist(),
            "absorption_per_m": water.absorption.tolist(), "scattering_per_m": water.scattering.tolist(),
            "phase_function": phase.describe(water.phase),
        },
        "particles": [],
    }  # fmt: skip
    shape = (HEIGHT_PX, WIDTH_PX)
    normals = np.zeros((*shape, 3), np.float16)
    normals[..., 0] = -1
    buffers = {"range": np.full(shape, 2.0, np.float32), "normal": normals}
    return info, buffers | {"albedo": np.broadcast_to(np.float16(bands), (*shape, 3))}


def points(count=200, seed=2) -> np.ndarray:
    """Points in front of the lamp, in the world."""
    rng = np.random.default_rng(seed)
    local = np.stack([*rng.uniform(-0.4, 0.4, (2, count)), rng.uniform(0.1, 1.5, count)], axis=-1)
    return local @ WORLD_FROM_LAMP[:3, :3].T + WORLD_FROM_LAMP[:3, 3]


def local_of(world: np.ndarray) -> np.ndarray:
    return (world - WORLD_FROM_LAMP[:3, 3]) @ WORLD_FROM_LAMP[:3, :3]


def test_a_grey_frame():
    """Expected: one grey spectrum, rays of the camera's lens, and the frame's water at every wavelength."""
    info, buffers = frame()
    view = view_of_frame(info, buffers)
    assert view.shape == (HEIGHT_PX, WIDTH_PX)
    assert view.albedo_spectra.shape == (1, 61)
    np.testing.assert_allclose(view.albedo[..., 0], np.float16(0.4), rtol=1e-6)
    middle = view.directions.mean(axis=(0, 1))
    np.testing.assert_allclose(middle / np.linalg.norm(middle), [1, 0, 0], atol=1e-9)
    np.testing.assert_allclose(view.origins_m, np.broadcast_to([0, 0, -1.0], view.origins_m.shape), atol=1e-12)
    assert np.all(view.factor == 1)
    water, angle = named_water("tank_low"), np.array([0.01, 1.0, 3.0])
    np.testing.assert_allclose(view.water.attenuation, water.attenuation)
    np.testing.assert_allclose(view.water.phase.density_at(angle), water.phase.density_at(angle), rtol=1e-6)
    assert view.pixel_angle_rad == pytest.approx(2 * np.arctan(0.5 / 15.0), rel=1e-9)
    np.testing.assert_allclose(view.points_m[4, 6], view.origins_m[4, 6] + 2 * view.directions[4, 6])


def test_colours_keep_their_band_values():
    """Expected: the spectra of a coloured frame have the stored band albedos; of the ColorChecker they are smooth
    guesses within 0.1. Negative control: band values taken as they are, without what the bands share."""
    response = views.RESPONSE
    patches = np.stack([reflectance for _, reflectance in colorchecker()])
    weights = views.view().weights
    bands = (fine(patches) @ weights)[None]
    albedo, spectra = albedo_of_bands(bands, response=response)
    assert spectra.shape == (3, 61)
    np.testing.assert_allclose(spectra.sum(axis=0), 1, rtol=1e-9)
    back = fine(albedo[0].astype(float) @ spectra) @ weights
    np.testing.assert_allclose(back, bands[0], atol=1e-5)
    assert np.mean(np.abs(albedo[0] @ spectra - patches)) < 0.05
    assert np.abs(fine(bands[0] @ spectra) @ weights - bands[0]).max() > 0.01
    grey, _ = albedo_of_bands(np.concatenate([bands, np.full((1, 1, 3), 0.3)], axis=1), response=response)
    np.testing.assert_allclose(grey[0, -1] @ spectra, 0.3, rtol=1e-5)


def test_a_port_dims_the_picture_and_bends_its_rays():
    """Expected: T (n_air / n_water)^2 = 0.9567 / 1.334^2 on the axis within 1 %, and a pixel of less angle in the
    water than in air, by the index. Negative control: no port."""
    port = FlatPort(gap_m=0.03, thickness_m=0.01, n_glass=1.52, n_water=1.334)
    with_port = view_of_frame(*frame(port=port_record(port)))
    assert with_port.factor[4, 6] == pytest.approx(0.9567 / 1.334**2, rel=0.01)
    without = view_of_frame(*frame())
    assert with_port.pixel_angle_rad == pytest.approx(without.pixel_angle_rad / 1.334, rel=2e-3)
    assert np.linalg.norm(with_port.origins_m[4, 6] - [0, 0, -1]) == pytest.approx(0.04, rel=0.01)


def test_pixels_without_a_ray_are_black():
    """Expected: a port tilted so far that some rays miss it: no ray, factor 0, no body."""
    port = FlatPort(gap_m=0.03, thickness_m=0.01, n_glass=1.52, n_water=1.334, normal=(np.sin(1.4), 0, np.cos(1.4)))
    view = view_of_frame(*frame(port=port_record(port)))
    assert 0 < view.has_ray.sum() < view.has_ray.size
    assert not view.factor[~view.has_ray].any()
    assert not view.has_body[~view.has_ray].any()
    assert np.all(np.isfinite(view.points_m))


def test_a_bare_lamp():
    """Expected: cos^m / r^2 normal to the ray, the LED's share of the intensity, nothing behind it."""
    (led,) = records.leds(lamp_record())
    local = local_of(points())
    distance = np.linalg.norm(local, axis=-1)
    came = led.arriving(points())
    order = -np.log(2) / np.log(np.cos(np.radians(40)))
    np.testing.assert_allclose(came.irradiance_per_intensity, (local[:, 2] / distance) ** order / distance**2)
    np.testing.assert_allclose(came.towards, -(points() - WORLD_FROM_LAMP[:3, 3]) / distance[:, None], atol=1e-12)
    np.testing.assert_allclose(came.path_m, distance)
    np.testing.assert_allclose(led.spectrum, 3 * illuminant("LED-B3"))
    behind = WORLD_FROM_LAMP[:3, 3] - 0.5 * WORLD_FROM_LAMP[:3, 2]
    assert led.arriving(behind).irradiance_per_intensity == 0


def test_an_array_behind_a_window_is_the_sum_of_its_leds():
    """Expected: `optics.lamp_array` for a tilted ring, on a plane parallel to the window, LED by LED. Tolerance:
    round-off. Negative control: the LEDs in the middle of the window."""
    emitters = lamp_array.ring(
        Beam(1.0, records.leds(lamp_record())[0].profile), count=3, radius_m=0.012, outward_tilt_rad=0.2
    )
    leds = [
        (WORLD_FROM_LAMP @ pose.from_parts(e.beam.window_from_beam, (*e.position_m, 0.0))).tolist() for e in emitters
    ]
    found = records.leds(lamp_record(world_from_leds=leds, window=FLAT_RECORD))
    assert [led.name for led in found] == ["led[0]", "led[1]", "led[2]"]
    np.testing.assert_allclose(found[0].spectrum, illuminant("LED-B3"))
    local = local_of(points())
    on_plane = {"lateral_m": local[:, :2], "depth_m": local[:, 2] - 0.016}
    seen = on_plane["depth_m"] > 0
    on_plane = {key: values[seen] for key, values in on_plane.items()}
    for led, emitter in zip(found, emitters, strict=True):
        field = exact_field(emitter.beam, FLAT, **on_plane, emitter_m=emitter.position_m)
        came = led.arriving(points()[seen])
        np.testing.assert_allclose(
            came.irradiance_per_intensity * np.cos(field.water_angle_rad), field.irradiance_w_per_m2, rtol=1e-9
        )
        np.testing.assert_allclose(came.path_m, field.path_m, rtol=1e-9)
        # the ray leaves through the face, where the light entered the water
        entry = local_of(points()[seen] + came.path_m[:, None] * came.towards)
        np.testing.assert_allclose(entry[:, 2], 0.016, atol=1e-9)
    middle = exact_field(emitters[0].beam, FLAT, **on_plane).irradiance_w_per_m2
    whole = found[0].arriving(points()[seen]).irradiance_per_intensity
    assert np.abs(whole.sum() / middle.sum() - 1) > 0.005


def test_no_light_inside_the_lamp():
    (led,) = records.leds(lamp_record(window=FLAT_RECORD))
    inside = WORLD_FROM_LAMP[:3, 3] + 0.012 * WORLD_FROM_LAMP[:3, 2]
    assert led.arriving(inside).irradiance_per_intensity == 0
    apparent = local_of(led.apparent_m)
    np.testing.assert_allclose(apparent, [0, 0, 0.016 - FLAT.virtual_distance_m], atol=1e-12)


def test_a_dome():
    """Expected: `optics.window_field.dome_field` over the transmittance through the dome in air (calibration)."""
    (led,) = records.leds(lamp_record(window=DOME_RECORD))
    shared = {"inner_radius_m": 0.02, "thickness_m": 0.004, "n_glass": 1.52, "glass_absorption_per_m": 1.0}
    dome = DomeWindow(**shared, n_water=1.334, half_aperture_rad=float(np.radians(80)))
    local = local_of(points())
    field = dome_field(Beam(1.0, led.profile), dome, lateral_m=local[:, :2], depth_m=local[:, 2])
    came = led.arriving(points())
    on_plane = came.irradiance_per_intensity * np.cos(field.water_angle_rad)
    in_air = DomeWindow(**shared, n_water=1.0).transmittance
    np.testing.assert_allclose(on_plane, field.irradiance_w_per_m2 / in_air, rtol=1e-9)
    np.testing.assert_allclose(came.path_m, field.path_m, rtol=1e-9)


def test_measured_beams():
    """Expected: a table over the angle, and one over azimuth and angle with two planes of symmetry."""
    table = {"half_angle_deg": None, "beam_angles_deg": [0.0, 20.0, 40.0]}
    (round_beam,) = records.leds(lamp_record(**table, beam_values=[2.0, 1.0, 0.0]))
    np.testing.assert_allclose(round_beam.profile(np.radians([0, 10, 30, 60]), np.zeros(4)), [1, 0.75, 0.25, 0])
    (beam,) = records.leds(
        lamp_record(**table, beam_azimuths_deg=[0.0, 90.0], beam_table=[[1.0, 0.8, 0.0], [1.0, 0.4, 0.0]])
    )
    angle, azimuth = np.radians([20.0, 20.0, 20.0, 20.0]), np.radians([0.0, 90.0, 135.0, -180.0])
    np.testing.assert_allclose(beam.profile(angle, azimuth), [0.8, 0.4, 0.6, 0.8])


@pytest.mark.parametrize(
    "function",
    [
        FournierForand(n=1.1, mu=3.58),
        petzold("harbor"),
        Rayleigh(),
        two_term(share=0.9, g_forward=0.9, g_backward=-0.3),
    ],
    ids=["fournier_forand", "petzold", "rayleigh", "two_term"],
)
def test_phase_functions_come_back(function):
    angle = np.radians([0.2, 3.0, 60.0, 150.0, 180.0])
    described = phase.describe(phase.grey(function))
    np.testing.assert_allclose(records.phase(described).density_at(angle)[:, 0], function.density(angle), rtol=1e-6)


def test_what_a_view_does_not_hold_is_refused():
    info, buffers = frame(readout_s=0.01)
    with pytest.raises(ValueError, match="camera.readout_s is 0.01, allowed: 0"):
        view_of_frame(info, buffers)
    info, buffers = frame()
    with pytest.raises(ValueError, match="1 clouds of marine snow, allowed: none"):
        view_of_frame(info | {"particles": [{}]}, buffers)
    with pytest.raises(ValueError, match="1 added waters, allowed: none"):
        view_of_frame(info | {"added_water": [{}]}, buffers)
    with pytest.raises(ValueError, match="buffers normal missing, allowed: "):
        view_of_frame(info, {key: buffers[key] for key in ("range", "albedo")})
    with pytest.raises(ValueError, match="wavelengths_nm has 3 nodes, allowed: "):
        view_of_frame(info | {"water": info["water"] | {"wavelengths_nm": [400, 500, 700]}}, buffers)
    with pytest.raises(ValueError, match="phase_function.type: got 'mie', allowed: "):
        records.phase({"type": "mie", "weights": []})
    for wrong, message in (
        ({"range_m": np.full((12, 16), -1.0)}, "range_m is -1"),
        ({"pixel_angle_rad": 0.0}, "pixel_angle_rad is 0"),
        ({"factor": np.ones((3, 3))}, "factor has shape"),
        ({"visibility": np.ones((12, 16, 2))}, "visibility has shape"),
    ):
        with pytest.raises(ValueError, match=f"view: {message}.*, allowed: "):
            views.view(**wrong)
    with pytest.raises(ValueError, match="towards_sun .*, allowed: "):
        Daylight(towards_sun=np.array([0, 0, -1.0]), sun_irradiance=views.FLAT, sky_irradiance=views.FLAT)


def test_the_angle_of_a_pixel_is_that_of_the_lens():
    lens = Lens(K=np.array([[100.0, 0, 5], [0, 100.0, 5], [0, 0, 1]]))
    assert pixel_angle_rad(lens, width_px=10, height_px=10) == pytest.approx(2 * np.arctan(0.005), rel=1e-9)
    assert band_values(views.view(), views.FLAT) == pytest.approx(1.0)


def test_daylight_below_the_surface():
    """Expected: the refracted sun of 40 degrees towards y, its flux through the surface kept (on a horizontal plane
    T E), and the sky's irradiance times its transmittance, 0.934 for a uniform sky. Negative control: the direction in
    air. No entry, no daylight."""
    record = {
        "sun_zenith_deg": 40.0, "sun_azimuth_deg": 90.0, "sun_irradiance_w_per_m2": 400.0, "sky": "uniform",
        "sky_irradiance_w_per_m2": 100.0, "spectrum": "E", "refractive_index": 1.334,
        "relative_spectrum_per_nm": (views.FLAT / 300).tolist(),
    }  # fmt: skip
    info, buffers = frame()
    assert view_of_frame(info, buffers).daylight is None
    found = view_of_frame(info | {"daylight": record}, buffers).daylight
    sine = np.sin(np.radians(40)) / 1.334
    np.testing.assert_allclose(found.towards_sun, [0, sine, np.sqrt(1 - sine**2)], atol=1e-12)
    assert np.abs(found.towards_sun[1] - np.sin(np.radians(40))) > 0.1
    passed = float(surface_transmittance(np.radians(40), n_water=1.334))
    np.testing.assert_allclose(found.sun_irradiance * found.towards_sun[2], 400 / 300 * passed)
    np.testing.assert_allclose(found.sky_irradiance, 100 / 300 * 0.934, rtol=2e-3)
    below = found.sun_path_m(np.array([[0, 0, -2.0], [0, 0, 0.5]]))
    np.testing.assert_allclose(below, [2 / found.towards_sun[2], 0])
