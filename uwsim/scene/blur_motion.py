"""Motion of a rig given by what it does to the picture: the length and direction of the blur at the image's centre."""

from typing import Annotated

import numpy as np
from pydantic import Discriminator, Field, Tag

from uwsim.camera import pose
from uwsim.camera.lens import Lens
from uwsim.camera.shutter import Shutter, see
from uwsim.scene.base import NonNegative, Positive, Strict, Vector3
from uwsim.scene.camera import Motion

_ROUNDS = 30
_CLOSE_PX = 1e-6
_STEP = 1e-4  # of the range, for the derivative of the projection


class BlurMotion(Strict):
    """Uniform sideways motion of the rig, such that the blur at the image's centre is as asked.

    What the image's centre sees in the middle of the exposure, taken to be at rest, moves through the image by
    `blur_length_px` towards `blur_angle_deg` (x right, y up) from the exposure's start to its end. `range_m`: how far
    it is along the ray in the water, from the pinhole or the port's outer face; without it, where the ray meets the
    first body. `rotation_deg_per_s`: turn about the rig's own axes, counted in: about x and y it turns the picture's
    centre too, and the rig moves sideways as much more or less. A validated scene holds the `Motion` that does it.
    """

    blur_length_px: Annotated[NonNegative, Field(le=10_000)]
    blur_angle_deg: Annotated[float, Field(ge=0, lt=360)]
    range_m: Positive | None = None
    rotation_deg_per_s: Vector3 = (0.0, 0.0, 0.0)

    def motion(self, *, lens: Lens, shutter: Shutter, width_px: int, range_m: float) -> Motion:
        """Return the uniform motion, along and about the rig's axes, that blurs so what is at `range_m`.

        By Newton's method on the projection through lens and port, with start and end of the exposure as in the flow.
        Raises ValueError if the camera does not see the point at both, or no motion is found.
        """
        centre = np.array([width_px, shutter.height_px]) / 2
        origin, direction = lens.rays(centre)
        if not np.all(np.isfinite(direction)):
            raise ValueError("rig.motion: the image's centre has no ray through lens and port, allowed: one that has")
        angle = np.radians(self.blur_angle_deg)
        wanted = self.blur_length_px * np.array([np.cos(angle), -np.sin(angle)])
        point = origin + range_m * direction  # in the rig's frame; where that is in the world does not matter

        def missed(shift_m: np.ndarray) -> np.ndarray:
            velocity = (*(shift_m / shutter.exposure_s), 0.0)
            settings = {"velocity_m_per_s": velocity, "rotation_deg_per_s": self.rotation_deg_per_s}
            ends = [
                see(
                    point, lens=lens, shutter=shutter, phase=phase,
                    poses_at=lambda times_s: pose.through_exposure(np.eye(4), **settings, times_s=times_s),
                )[0]
                for phase in (-0.5, 0.5)
            ]  # fmt: skip
            return ends[1] - ends[0] - wanted

        shift_m = _root(missed, step_m=_STEP * range_m)
        if shift_m is None:
            raise ValueError(
                f"rig.motion: no sideways motion blurs by {self.blur_length_px:g} px at {range_m:g} m, allowed: "
                "a blur whose start and end the camera sees"
            )
        velocity = shift_m / shutter.exposure_s
        return Motion(
            velocity_m_per_s=(float(velocity[0]), float(velocity[1]), 0.0), rotation_deg_per_s=self.rotation_deg_per_s
        )


def _way_to_say(given: object) -> str:
    """Return which of the two models of a motion is meant."""
    keys = given if isinstance(given, dict) else getattr(type(given), "model_fields", ())
    return "BlurMotion" if any(key.startswith("blur_") or key == "range_m" for key in keys) else "Motion"


AnyMotion = Annotated[
    Annotated[Motion, Tag("Motion")] | Annotated[BlurMotion, Tag("BlurMotion")], Discriminator(_way_to_say)
]


def _root(missed, *, step_m: float) -> np.ndarray | None:
    """Return where a function (2,) -> (2,) vanishes, None if that is not found."""
    at = np.zeros(2)
    for _ in range(_ROUNDS):
        here = missed(at)
        if not np.all(np.isfinite(here)):
            return None
        if np.abs(here).max() < _CLOSE_PX:
            return at
        slope = np.stack([(missed(at + way) - missed(at - way)) / (2 * step_m) for way in step_m * np.eye(2)], axis=-1)
        if not np.all(np.isfinite(slope)) or abs(np.linalg.det(slope)) < 1e-12:
            return None
        at = at - np.linalg.solve(slope, here)
    return None
