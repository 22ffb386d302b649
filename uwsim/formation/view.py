"""What a formation model is given: rays, geometry, water and light of one picture, as arrays."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uwsim.camera.lens import Lens, lens_from_record, pixel_centres
from uwsim.formation import records
from uwsim.formation.bands import FINE_NM, Decay, band_weights, fine
from uwsim.formation.light import Daylight, Lamp
from uwsim.optics.sources import camera_response
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.optics.water import Water

_GREY = 1e-3  # spread of an albedo over the bands, as half precision may leave of none


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """One picture to be formed, without motion. World axes (z up, surface at z = 0), metres; H x W pixels.

    `origins_m`, `directions` (H, W, 3): where the ray through a pixel's centre enters the water, and its unit
    direction there; NaN for pixels without a ray. `range_m` (H, W): along the ray in the water, +inf where no body
    is seen. `normals` (H, W, 3): unit, towards the camera; 0 without a body. `albedo` (H, W, K), `albedo_spectra`
    (K, 61): the reflectance of a pixel is albedo @ albedo_spectra; bodies are Lambertian.
    `lamps`: one per LED. `daylight`: None, or sun and sky. `response` (61, 3). `factor` (H, W): radiance in the camera
    over radiance in the water; 0 for pixels without a ray. `pixel_angle_rad`: angle in the water that one pixel
    subtends at the image's centre. `visibility` (H, W, lamps) or None: share of each lamp's light that bodies let
    pass to the body seen (None: all); what the normal turns away from the lamp is dark in any case.
    """

    origins_m: np.ndarray
    directions: np.ndarray
    range_m: np.ndarray
    normals: np.ndarray
    albedo: np.ndarray
    albedo_spectra: np.ndarray
    water: Water
    lamps: tuple[Lamp, ...]
    response: np.ndarray
    factor: np.ndarray
    pixel_angle_rad: float
    daylight: Daylight | None = None
    visibility: np.ndarray | None = None

    def __post_init__(self):
        h, w = np.shape(self.range_m)
        shapes = {
            "origins_m": (h, w, 3), "directions": (h, w, 3), "normals": (h, w, 3), "factor": (h, w),
            "albedo": (h, w, len(self.albedo_spectra)), "albedo_spectra": (len(self.albedo_spectra), 61),
        }  # fmt: skip
        if self.visibility is not None:
            shapes["visibility"] = (h, w, len(self.lamps))
        for name, allowed in shapes.items():
            if np.shape(getattr(self, name)) != allowed:
                raise ValueError(f"view: {name} has shape {np.shape(getattr(self, name))}, allowed: {allowed}")
        if not np.all(np.asarray(self.range_m) >= 0):
            raise ValueError(f"view: range_m is {np.min(self.range_m):g}, allowed: >= 0 (+inf without a body)")
        if not (np.isfinite(self.pixel_angle_rad) and self.pixel_angle_rad > 0):
            raise ValueError(f"view: pixel_angle_rad is {self.pixel_angle_rad:g}, allowed: above 0")
        _ = self.weights

    @property
    def shape(self) -> tuple[int, int]:
        """(H, W)."""
        return np.shape(self.range_m)

    @cached_property
    def weights(self) -> np.ndarray:
        """Weights (121, 3) of `bands.FINE_NM`: the band value of a spectrum is its sum with them."""
        return band_weights(self.response)

    @cached_property
    def decay(self) -> Decay:
        """Table of what the water leaves of every wavelength (`bands.PathTable`)."""
        return Decay(self.water.attenuation)

    @cached_property
    def band_light(self) -> np.ndarray:
        """Weights (121, 3) of response x light of the lamps (without lamps: of the day), each band's sum 1.

        Those of `water.bands` in frame.json. Without any light: of the response alone.
        """
        light = sum((lamp.spectrum for lamp in self.lamps), np.zeros(len(WAVELENGTHS_NM)))
        if not self.lamps and self.daylight is not None:
            light = self.daylight.sun_irradiance + self.daylight.sky_irradiance
        weighted = self.weights * fine(light)[:, None]
        total = weighted.sum(axis=0)
        # a band in which there is no light has no coefficients of its own
        return np.where(total > 0, weighted / np.where(total > 0, total, 1), self.weights)

    @cached_property
    def band_attenuation(self) -> np.ndarray:
        """Beam attenuation c of the three bands, weighted by `band_light`, (3,). [1/m]"""
        return fine(self.water.attenuation) @ self.band_light

    @cached_property
    def has_ray(self) -> np.ndarray:
        """Pixels with a ray in the water, (H, W) bool."""
        return np.all(np.isfinite(self.directions), axis=-1) & np.all(np.isfinite(self.origins_m), axis=-1)

    @cached_property
    def has_body(self) -> np.ndarray:
        """Pixels that see a body, (H, W) bool."""
        return np.isfinite(self.range_m) & self.has_ray

    @cached_property
    def points_m(self) -> np.ndarray:
        """Points seen, (H, W, 3) [m]; where no body is seen the place one metre along the ray, without a ray 0."""
        distance = np.where(self.has_body, self.range_m, 1.0)[..., None]
        return np.where(self.has_ray[..., None], self.origins_m + distance * self.directions, 0.0)


def view_of_frame(
    info: dict, buffers: dict[str, np.ndarray], *, visibility: np.ndarray | None = None
) -> View:  # fmt: skip
    """Return the view of a frame: `info` the content of frame.json, `buffers` its pictures by name.

    Needed buffers: `range`, `normal`, `albedo`. The instant is mid-exposure: in motion, of the frame's `sharp`.
    A frame does not say who shadows whom: `visibility` (H, W, lamps of frame.json) is handed in; for an array of LEDs
    it is the same for all. A water surface at night counts as daylight without light; what it reflects is not in a
    view. Housings cast no shadow, dies are points (`light.Lamp`).
    Reflectance spectra: frames hold band values. Where they are alike in all bands (charts), K = 1 and the spectrum is
    grey: exact. Else K = 3, spectra linear between the centroids of the bands and constant outside, with the stored
    band values: exact for grey, a smooth guess for colours.
    Raises ValueError for a rolling shutter, marine snow, added waters, and buffers missing or of another shape.
    """
    camera = info["camera"]
    if camera.get("readout_s", 0.0) != 0:
        raise ValueError(f"view: camera.readout_s is {camera['readout_s']:g}, allowed: 0 (no rolling shutter)")
    for entry, what in (("particles", "clouds of marine snow"), ("added_water", "added waters")):
        if info.get(entry):
            raise ValueError(f"view: the frame has {len(info[entry])} {what}, allowed: none")
    missing = [name for name in ("range", "normal", "albedo") if name not in buffers]
    if missing:
        raise ValueError(f"view: buffers {', '.join(missing)} missing, allowed: range, normal, albedo")
    lens, pose = lens_from_record(camera), np.array(camera["world_from_camera"], float)
    response = camera_response(camera["response"])
    pixels = pixel_centres(width_px=camera["width_px"], height_px=camera["height_px"])
    origins, directions = lens.rays(pixels)
    albedo, spectra = albedo_of_bands(buffers["albedo"], response=response)
    lamps = [records.leds(lamp) for lamp in info["lamps"]]
    if visibility is not None:
        visibility = np.repeat(visibility, [len(leds) for leds in lamps], axis=-1)
    return View(
        origins_m=origins @ pose[:3, :3].T + pose[:3, 3],
        directions=directions @ pose[:3, :3].T,
        range_m=np.asarray(buffers["range"]),
        normals=np.asarray(buffers["normal"], np.float32),
        albedo=albedo,
        albedo_spectra=spectra,
        water=records.water(info["water"]),
        lamps=tuple(led for leds in lamps for led in leds),
        response=response,
        factor=np.nan_to_num(lens.radiance_factor(pixels), nan=0.0),
        pixel_angle_rad=pixel_angle_rad(lens, width_px=camera["width_px"], height_px=camera["height_px"]),
        daylight=records.daylight(info.get("daylight")),
        visibility=visibility,
    )


def pixel_angle_rad(lens: Lens, *, width_px: int, height_px: int) -> float:
    """Return the angle in the water between rays one pixel apart at the centre of the image: mean of x and y. [rad]"""
    centre = np.array([width_px / 2, height_px / 2])
    ends = centre + 0.5 * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])
    right, left, low, high = lens.rays(ends)[1]
    angles = [np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b) for a, b in ((right, left), (low, high))]
    return float(np.mean(angles))


def albedo_of_bands(bands: np.ndarray, *, response: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return albedo (H, W, K) and albedo spectra (K, 61) for band albedos (H, W, 3), as `view_of_frame` says."""
    bands = np.asarray(bands, np.float32)
    mean = bands.mean(axis=-1, keepdims=True)
    if np.all(np.abs(bands - mean) <= _GREY * mean + 1e-7):
        return mean, np.ones((1, len(WAVELENGTHS_NM)))
    weights = band_weights(response)
    centroids = FINE_NM @ weights
    order = np.argsort(centroids)
    hats = np.stack([np.interp(WAVELENGTHS_NM, centroids[order], row) for row in np.eye(3)[np.argsort(order)]])
    # band values of the hats, one row per band: what the mixture must give is what is stored
    mixing = (fine(hats) @ weights).T
    return bands @ np.linalg.inv(mixing).T.astype(np.float32), hats
