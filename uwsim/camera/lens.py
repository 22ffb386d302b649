"""What a camera sees in the water: one object for the pinhole in the water and for lenses behind ports.

Camera frame: entrance pupil at the origin, x right, y down, z forward; pixel centres at integer + 0.5.
"""

import dataclasses
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uwsim.camera import distortion, pinhole, port
from uwsim.camera.dome_port import DomePort
from uwsim.camera.flat_port import FlatPort
from uwsim.camera.port import Status
from uwsim.camera.refraction import Rays


@dataclass(frozen=True, kw_only=True, eq=False)
class Lens:
    """Pinhole `K` (3, 3) [px] with a distortion, in the water or in the air behind a port.

    `coefficients`: 0, 4, 5 or 8 numbers (`uwsim.camera.distortion`). `port` None: the pinhole lies in the water and
    nothing is lost. Raises ValueError for coefficients that are none.
    """

    K: np.ndarray
    coefficients: tuple[float, ...] = ()
    port: FlatPort | DomePort | None = None

    def __post_init__(self):
        distortion.checked(self.coefficients)

    @cached_property
    def is_distorted(self) -> bool:
        return bool(np.any(distortion.checked(self.coefficients)))

    def rays(self, pixels_px: np.ndarray) -> Rays:
        """Return the rays in the water of pixels (..., 2): origins [m] and unit directions, (..., 3).

        Origins lie in the pinhole or on the port's outer face. NaN where the lens or the port has no ray.
        """
        directions = self._directions(np.asarray(pixels_px, float))
        if self.port is not None:
            return self.port.water_rays(directions)
        return np.where(np.isfinite(directions), 0.0, np.nan), directions

    def _directions(self, pixels_px: np.ndarray) -> np.ndarray:
        if self.is_distorted:
            return distortion.directions(pixels_px, self.K, coefficients=self.coefficients)
        homogeneous = np.concatenate([pixels_px, np.ones_like(pixels_px[..., :1])], axis=-1)
        directions = homogeneous @ np.linalg.inv(self.K).T
        return directions / np.linalg.norm(directions, axis=-1, keepdims=True)

    def project(self, points_camera_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return pixels (..., 2) of points in the water (..., 3) [m], and `Status` (...) int8; NaN unless SEEN."""
        points = np.asarray(points_camera_m, float)
        if self.port is not None:
            return port.project(points, port=self.port, K=self.K, coefficients=self.coefficients)
        if self.is_distorted:
            pixels = distortion.project(points, self.K, coefficients=self.coefficients)
        else:
            pixels = pinhole.project(points, self.K)
        status = np.where(np.all(np.isfinite(pixels), axis=-1), Status.SEEN, Status.NO_PIXEL)
        finite = np.all(np.isfinite(points), axis=-1)
        return pixels, np.where(finite, status, Status.NOT_IN_WATER).astype(np.int8)

    def transmittance(self, pixels_px: np.ndarray) -> np.ndarray:
        """Return the share of power (...) that reaches pixels (..., 2) through the port; NaN without a ray."""
        directions = self._directions(np.asarray(pixels_px, float))
        if self.port is not None:
            return self.port.transmittance(directions)
        return np.where(np.all(np.isfinite(directions), axis=-1), 1.0, np.nan)

    @property
    def index_factor(self) -> float:
        """(n_air / n_water)^2: what the change of index does to radiance; 1 for a pinhole in the water."""
        return 1.0 if self.port is None else (self.port.n_air / self.port.n_water) ** 2

    def radiance_factor(self, pixels_px: np.ndarray) -> np.ndarray:
        """Return radiance at pixels (..., 2) over that in the water, (...): T (n_air / n_water)^2; NaN without a ray.

        Source: conservation of basic radiance L / n^2 along a ray, times the port's transmittance.
        """
        return self.transmittance(pixels_px) * self.index_factor


def pixel_centres(*, width_px: int, height_px: int) -> np.ndarray:
    """Return the centres of all pixels, (H, W, 2) [px]."""
    rows, columns = np.mgrid[0:height_px, 0:width_px] + 0.5
    return np.stack([columns, rows], axis=-1)


def port_record(found: FlatPort | DomePort | None) -> dict | None:
    """Return the `port` entry of a frame.json: the numbers of a port and its kind; None without one."""
    if found is None:
        return None
    return {"kind": "flat" if isinstance(found, FlatPort) else "dome"} | dataclasses.asdict(found)


def lens_from_record(camera: dict) -> Lens:
    """Return the lens that the `camera` entry of a frame.json describes (`K`, `distortion`, `port`)."""
    given = camera.get("port") or {}
    record = {key: tuple(value) if isinstance(value, list) else value for key, value in given.items()}
    kinds = {"flat": FlatPort, "dome": DomePort}
    kind = kinds[record.pop("kind")] if record else None
    return Lens(
        K=np.array(camera["K"], float),
        coefficients=tuple(camera.get("distortion", ())),
        port=None if kind is None else kind(**record),
    )
