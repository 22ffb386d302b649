"""Draw what motion does to a picture and what a convolution makes of it: sharp, blurred, convolved, difference.

    python scripts/motion_kernel.py OUT.png

A rig moves sideways along a far flat chart, once alone and once with a near plate in front of it. The sharp picture
convolved with the kernel of the chart's motion is the blurred one on the chart alone, and is not on the plate and
around its edges: there the streaks have another length, and cover and uncover the chart.
"""

import sys
from pathlib import Path

import numpy as np

SPEED_M_PER_S = 1.2
EXPOSURE_S = 0.05
CHART_M, PLATE_M = 1.6, 0.7  # from the camera
WIDTH_PX, HEIGHT_PX = 128, 80


def scene(*, plate: bool, height_px: int = HEIGHT_PX):
    """Return the scene: a chart in the plane of motion, lit as by day, with or without the near plate."""
    from uwsim.scene.models import Scene

    chart = {
        "name": "chart", "kind": "usaf_1951", "width_m": 1.6, "first_group": -6, "last_group": -4,
        "position_m": (0.0, CHART_M, -3.0), "towards_m": (0.0, 0.0, -3.0),
    }  # fmt: skip
    near = {
        "name": "plate", "kind": "rectangle", "width_m": 0.15, "height_m": 0.2, "reflectance": 0.2,
        "position_m": (0.0, PLATE_M, -3.05), "towards_m": (0.0, 0.0, -3.05),
    }  # fmt: skip
    return Scene.model_validate(
        {
            "name": "motion",
            "description": "sideways along a far chart",
            "water": {"name": "tank_clear"},
            "rig": {
                "position_m": (0.0, 0.0, -3.0),
                "look_at_m": (0.0, 1.0, -3.0),
                "camera": {"width_px": WIDTH_PX, "height_px": height_px, "horizontal_fov_deg": 40.0},
                "motion": {"velocity_m_per_s": (SPEED_M_PER_S, 0.0, 0.0)},
            },
            "daylight": {"sun_irradiance_w_per_m2": 100.0, "sun_zenith_deg": 60.0, "sun_azimuth_deg": -90.0},
            "bodies": (chart, near) if plate else (chart,),
            "exposure": {"time_s": EXPOSURE_S},
        }
    )


def pictures(chosen, *, samples: int, batches: int = 4, seed: int = 1) -> dict[str, np.ndarray]:
    """Return `blurred` and `sharp` (H, W, 3) without water, the chart's displacement [px], and the instance buffer."""
    from uwsim.render import film, geometry, motion, transport
    from uwsim.render.build import build, exposure_poses

    view = film.view_of(chosen)
    buffers = geometry.geometry(chosen, view)
    start, end = motion.flow(chosen, view, buffers["range"])
    steps = motion.exposure_steps(chosen, view, buffers["range"])
    at_once, middle = motion.momentary(chosen, view, steps=steps)
    found = {}
    for name, seen, poses in (("blurred", view, exposure_poses(chosen, steps=steps)[1]), ("sharp", at_once, middle)):
        built = build(chosen, water=None, rig_poses=poses)
        rendered = transport.layers(built, seen, samples_per_pixel=samples, batches=batches, seed=seed)
        found |= {name: rendered["radiance"], f"{name}_error": rendered["standard_error"]}
    streak = (end - start)[buffers["instance"] == 1]
    return found | {"streak_px": np.median(streak, axis=0), "instance": buffers["instance"]}


def convolved(found: dict[str, np.ndarray]) -> np.ndarray:
    """Return the sharp picture convolved with the kernel of the chart's motion."""
    from uwsim.motion_blur import kernels

    right, down = found["streak_px"]
    return kernels.blur(
        found["sharp"], length_px=float(np.hypot(right, down)), angle_deg=float(np.degrees(np.arctan2(-down, right)))
    )


def main(out: Path) -> None:
    import cv2

    from uwsim.images import srgb_uint8_from_linear
    from uwsim.render import variants

    variants.use()
    rows = []
    for plate in (False, True):
        found = pictures(scene(plate=plate), samples=256)
        made = convolved(found)
        scale = 0.8 / np.percentile(found["sharp"], 99)
        difference = 0.5 + 2.0 * scale * (found["blurred"] - made)
        parts = [found["sharp"] * scale, found["blurred"] * scale, made * scale]
        rows.append(np.hstack([*map(srgb_uint8_from_linear, parts), np.uint8(255 * np.clip(difference, 0, 1))]))
    picture = np.repeat(np.repeat(np.vstack(rows), 3, axis=0), 3, axis=1)
    if not cv2.imwrite(str(out), picture[..., ::-1]):
        raise SystemExit(f"{out}: cannot be written")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        raise SystemExit(__doc__)
    main(Path(sys.argv[1]))
