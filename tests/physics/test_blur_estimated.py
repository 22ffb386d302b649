"""What an estimator finds in rendered pictures is the blur that their labels state: the exposure's ends are right.

Setup: a wall with a Gaussian field on it, without detail that the pixels do not resolve (what they fold back is blurred
by another frequency's transfer and fills the zeros), seen without water from a rig in motion; before the sensor.
Expected: length and angle of the label. Tolerance: 0.05 px and 0.2 degrees. Monte Carlo: less than 0.2 % of the mean.
"""

import numpy as np
import pytest

from uwsim.motion_blur.estimators import whittle
from uwsim.render import film, geometry, motion, transport
from uwsim.render.build import build, exposure_poses
from uwsim.scene.models import Scene

TEXELS, TEXEL_M = 1024, 0.001
EXPONENT, FINEST_TEXELS = 2.6, 1.5
NOISE_SHARE = 0.002
BATCHES, MOST_SAMPLES = 8, 2048
BLURS = [(4.0, 20.0), (7.0, 110.0), (12.0, 65.0)]

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module", autouse=True)
def _variant(llvm_spectral):
    pass


def field(seed: int) -> np.ndarray:
    """Return a Gaussian field of the spectrum 1 / r^2.6, (TEXELS, TEXELS) in 0 to 1, without its finest detail."""
    rng = np.random.default_rng(seed)
    u = np.fft.fftfreq(TEXELS)
    r = np.hypot(u, u[:, None])
    amplitude = np.maximum(r, 4 / TEXELS) ** (-EXPONENT / 2) * np.exp(-2 * (np.pi * FINEST_TEXELS * r) ** 2)
    drawn = np.fft.ifft2(np.fft.fft2(rng.standard_normal(r.shape)) * amplitude).real
    return np.clip(0.4 + 0.14 * (drawn - drawn.mean()) / drawn.std(), 0, 1)


def scene_of(folder, *, length_px: float, angle_deg: float, seed: int) -> Scene:
    import cv2

    path = folder / f"field{seed}.png"
    cv2.imwrite(str(path), np.rint(255 * field(seed)).astype(np.uint8))
    wall = {
        "name": "wall", "kind": "textured", "file": str(path), "width_m": TEXELS * TEXEL_M,
        "position_m": (0.0, 0.8, -3.0), "towards_m": (0.0, 0.0, -3.0),
    }  # fmt: skip
    lamp = {"name": "led", "position_m": (-0.25, -0.1, 0.0), "look_at_m": (0.0, 0.0, 0.8), "radiant_flux_w": 8.0,
            "half_angle_deg": 45.0}  # fmt: skip
    rig = {
        "position_m": (0.0, 0.0, -3.0), "look_at_m": (0.0, 1.0, -3.0), "lamps": (lamp,),
        "camera": {"width_px": 320, "height_px": 240, "horizontal_fov_deg": 40.0},
        "motion": {"blur_length_px": length_px, "blur_angle_deg": angle_deg},
    }  # fmt: skip
    return Scene.model_validate(
        {
            "name": "wall", "description": "a field in motion", "water": {"name": "tank_clear"},
            "rig": rig, "exposure": {"time_s": 0.02}, "bodies": (wall,),
        }
    )  # fmt: skip


def rendered(scene: Scene, view, poses: np.ndarray, *, seed: int) -> np.ndarray:
    """Return the radiance (H, W, 3) without water, white at the 99th percentile; fail if it is not free enough of
    noise."""
    found = transport.layers(
        build(scene, water=None, rig_poses=poses), view, samples_per_pixel=MOST_SAMPLES, batches=BATCHES, seed=seed
    )
    image = found["radiance"].astype(float)
    noise = np.sqrt(np.mean(found["standard_error"].astype(float) ** 2)) / image.mean()
    assert noise < NOISE_SHARE, f"test has no power: noise {noise:.3%}"
    return (image / np.percentile(image, 99)).astype(np.float32)


@pytest.mark.parametrize(("length_px", "angle_deg"), BLURS)
def test_the_blur_found_is_that_of_the_label(tmp_path, length_px, angle_deg):
    """Negative control: an exposure whose first and last moments are the very ends of it, which is n / (n - 1) times
    as long."""
    scene = scene_of(tmp_path, length_px=length_px, angle_deg=angle_deg, seed=int(length_px))
    view = film.view_of(scene)
    seen = geometry.geometry(scene, view)
    start, end = motion.flow(scene, view, seen["range"], seen["instance"])
    label = motion.summarise_blur(end - start, seen["instance"] > 0)
    assert label["uniform"] and label["spread_px"] < 0.01
    steps = motion.exposure_steps(scene, view, seen["range"])
    poses = exposure_poses(scene, steps=steps)[1]

    def off(poses):
        estimate = whittle.estimate(rendered(scene, view, poses, seed=5))
        assert estimate.verdict == "blur"
        turned = (estimate.angle_deg - label["angle_deg"] + 90) % 180 - 90
        print(f"label {label['length_px']:.3f} px: off by {estimate.length_px - label['length_px']:+.4f} px, "
              f"{turned:+.3f} deg")  # fmt: skip
        return abs(estimate.length_px - label["length_px"]), abs(turned)

    length_off, angle_off = off(poses)
    assert length_off < 0.05
    assert angle_off < 0.2
    if (length_px, angle_deg) == BLURS[-1]:
        half_s = scene.shutter.exposure_s / 2
        assert off(scene.rig.poses_at(np.linspace(-half_s, half_s, steps)))[0] > 0.15
