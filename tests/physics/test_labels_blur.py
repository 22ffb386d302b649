"""The labels of blur: what was asked for is stored, and the kernel that a frame's truth gives is that of its picture.

Setup: frames as they are stored, in water that absorbs and does not scatter, in daylight (a lamp on the rig would
light every moment alike), through a flat port.
Expected: flow from start to end at the image's centre is the length and angle asked for, to 0.1 px; the picture is the
sharp one convolved with the effective kernel.
Tolerance: model (flow stored in half precision; pixels that do not resolve the chart's edges), Monte Carlo.
"""

import cv2
import numpy as np
import pytest

from uwsim.camera.streak import streak
from uwsim.dataset.frame import Frame, read_frame, write_frame
from uwsim.dataset.make import make_frame
from uwsim.motion_blur import kernels
from uwsim.scene.models import Scene

PORT = {"kind": "flat", "gap_m": 0.02, "thickness_m": 0.01}
EXPOSURE_S = 0.02
CHART_M = 1.5
MARGIN_PX = 14  # beyond which the kernel brings in nothing from outside the picture


@pytest.fixture(scope="module", autouse=True)
def _variant(llvm_spectral):
    pass


def scene(*, width_px: int, height_px: int, **changes) -> Scene:
    chart = {
        "name": "chart", "kind": "usaf_1951", "width_m": 2.4, "first_group": -6, "last_group": -5,
        "position_m": (0.0, CHART_M, -3.0), "towards_m": (0.0, 0.0, -3.0),
    }  # fmt: skip
    rig = {"camera": {"width_px": width_px, "height_px": height_px, "horizontal_fov_deg": 50.0, "port": PORT}}
    still = {"position_m": (0.0, 0.0, -3.0), "look_at_m": (0.0, 1.0, -3.0)}
    return Scene.model_validate(
        {
            "name": "blur", "description": "chart in daylight", "water": {"name": "tank_clear", "particle_factor": 0.0},
            "daylight": {"sun_irradiance_w_per_m2": 100.0, "sun_zenith_deg": 60.0, "sun_azimuth_deg": -90.0},
            "bodies": (chart,), "exposure": {"time_s": EXPOSURE_S},
            "rig": (changes if "trajectory" in changes else still | changes) | rig,
        }
    )  # fmt: skip


def stored(chosen: Scene, folder, *, samples: int) -> Frame:
    made = make_frame(chosen, name="000000", group="g", seed=1, frame=0, samples_per_pixel=samples, batches=4)
    write_frame(folder / "000000", **made)
    return read_frame(folder / "000000")


def centre_px(frame: Frame) -> np.ndarray:
    """Return the displacement (2,) from start to end at the corner in which the four middle pixels meet. [px]"""
    flow = frame.buffer("flow_end") - frame.buffer("flow_start")
    rows, columns = flow.shape[0] // 2, flow.shape[1] // 2
    return flow[rows - 1 : rows + 1, columns - 1 : columns + 1].mean(axis=(0, 1))


@pytest.mark.parametrize(
    ("length_px", "angle_deg", "turn_deg_per_s"),
    [(5.0, 0.0, (0.0, 0.0, 0.0)), (12.0, 60.0, (0.0, 0.0, 0.0)), (9.0, 135.0, (100.0, -150.0, 400.0))],
)
def test_the_stored_flow_at_the_centre_is_the_blur_asked_for(tmp_path, length_px, angle_deg, turn_deg_per_s):
    """Tolerance: 0.05 px (half precision). Negative control: the mirrored angle (y down) is pixels away."""
    motion = {"blur_length_px": length_px, "blur_angle_deg": angle_deg, "rotation_deg_per_s": turn_deg_per_s}
    frame = stored(scene(width_px=64, height_px=48, motion=motion), tmp_path, samples=8)
    angle = np.radians(angle_deg)
    off = centre_px(frame) - length_px * np.array([np.cos(angle), -np.sin(angle)])
    print(f"off by {np.abs(off).max():.4f} px")
    assert np.abs(off).max() < 0.05
    if angle_deg:
        assert np.abs(centre_px(frame) - length_px * np.array([np.cos(angle), np.sin(angle)])).max() > 5
    if not any(turn_deg_per_s):  # the chart is flat: all of it moves so, but for the port's refraction
        assert frame.info.blur.length_px == pytest.approx(length_px, rel=0.06)
        assert frame.info.blur.angle_deg == pytest.approx(angle_deg, abs=0.5)


# faster towards the end, and bent
PATH = {
    "times_s": (-0.01, -0.004, 0.002, 0.006, 0.01),
    "positions_m": ((-0.04, 0.0, -3.0), (-0.035, 0.0, -3.02), (0.0, 0.0, -3.03), (0.04, 0.0, -3.02), (0.1, 0.0, -3.0)),
    "look_at_m": ((-0.04, 1, -3), (-0.035, 1, -3.02), (0.0, 1, -3.03), (0.04, 1, -3.02), (0.1, 1, -3.0)),
}


def test_the_effective_kernel_blurs_the_sharp_picture_as_the_exposure_does(tmp_path):
    """Setup: a rig on an uneven, bent path before a chart. Expected: the sharp picture, convolved with the kernel at
    the image's centre from the poses in frame.json, range and lens, is the picture; 3.5 % rms (pixels, port, noise).
    The path's ends are those of the stored flow, 0.05 px. Negative controls: the straight uniform kernel between the
    same ends, the kernel turned by 180 degrees, the middle of the exposure taken half a pixel aside."""
    frame = stored(scene(width_px=96, height_px=72, trajectory=PATH), tmp_path, samples=512)
    ranges = frame.buffer("range")
    middle, range_m = np.array([48.0, 36.0]), ranges[35:37, 47:49].mean()
    path = streak(
        frame.info.camera.model_dump(), exposure_s=frame.info.sensor.exposure_time_s, pixels_px=middle,
        range_m=np.array(range_m),
    )  # fmt: skip
    assert path[-1] - path[0] == pytest.approx(centre_px(frame), abs=0.05)
    size = 2 * int(np.ceil(np.abs(path).max())) + 3
    assert size < 2 * MARGIN_PX
    sharp, blurred = (frame.buffer(name).astype(float) for name in ("sharp", "radiance"))

    def off(kernel, shift_px=(0.0, 0.0)):
        made = cv2.filter2D(sharp, -1, kernel[::-1, ::-1].copy(), borderType=cv2.BORDER_REFLECT)
        move = np.array([[1.0, 0.0, shift_px[0]], [0.0, 1.0, shift_px[1]]])
        made = cv2.warpAffine(made, move, made.shape[1::-1], flags=cv2.INTER_CUBIC) if any(shift_px) else made
        inner = (slice(MARGIN_PX, -MARGIN_PX), slice(MARGIN_PX, -MARGIN_PX))
        return float(np.sqrt(np.mean((made - blurred)[inner] ** 2) / np.mean(blurred[inner] ** 2)))

    found = off(kernels.kernel_of_path(size, path))
    noise = np.sqrt(np.mean(frame.buffer("standard_error") ** 2) / np.mean(blurred**2))
    wrong = {
        "straight": off(kernels.kernel_of_path(size, np.linspace(path[0], path[-1], 2))),
        "turned": off(kernels.kernel_of_path(size, -path)),
        "aside": off(kernels.kernel_of_path(size, path), (0.5, 0.5)),
        "sharp": off(kernels.kernel_of_path(size, np.zeros((2, 2)))),
    }
    print(f"rms {found:.4f}, noise {noise:.4f}, controls {wrong}")
    assert noise < 0.015, f"test has no power: {noise:.3g}"
    assert found < 0.035
    assert min(wrong.values()) > 1.7 * found
