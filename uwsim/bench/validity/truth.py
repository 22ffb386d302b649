"""A rendered frame as the truth of formation models: what they are given, and what they must come to."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from uwsim.bench.task import sensor_keywords
from uwsim.bench.validity.grain import Grain, grain_of
from uwsim.camera.sensor import expose_without_noise, linear_from_radiance, noise_std_radiance
from uwsim.dataset.frame import Frame
from uwsim.formation.bands import band_values
from uwsim.formation.view import View, view_of_frame
from uwsim.metrics import LAYERS, contrast, radiance

_CHART = "usaf_1951"
_BURIED_SHARE = 0.95  # of the pixels, where a case is called below the sensor's noise
_LIGHT = 1e-6  # of the brightest: below, a pixel gets none from the lamps
_SHOWN_NM = 550.0
_FINEST_CYCLES_PER_PX = 0.4


@dataclass(frozen=True)
class Truth:
    """A still frame lit by lamps; radiance (H, W, 3) as the renderer's."""

    frame: Frame

    @cached_property
    def radiance(self) -> np.ndarray:
        return self.frame.buffer("radiance")

    @cached_property
    def standard_error(self) -> np.ndarray:
        return self.frame.buffer("standard_error")

    @cached_property
    def grain(self) -> Grain:
        """In what blocks of pixels models are compared with the noisy truth."""
        return grain_of(self.radiance, standard_error=self.standard_error, batches=self.frame.info.batches)

    @cached_property
    def layers(self) -> dict[str, np.ndarray]:
        return {name: self.frame.buffer(name) for name in LAYERS}

    @cached_property
    def sensor(self) -> dict:
        return sensor_keywords(self.frame)

    def picture(self, light: np.ndarray) -> np.ndarray:
        """Return light (H, W, 3) as the frame's camera stores it without noise, 8-bit sRGB; below 0 is black."""
        return expose_without_noise(np.maximum(light, 0), **self.sensor)

    def grey(self, light: np.ndarray) -> np.ndarray:
        """Return light (H, W, 3) as brightness (H, W): the mean of the bands of the linear picture."""
        return linear_from_radiance(light, **self.sensor).mean(axis=-1)

    @cached_property
    def view(self) -> View:
        """What the models are given: nobody may write to its arrays.

        The reflectance is that of the whole pixel, not of its centre (`albedo`): from the twin without water and the
        lamps' unscattered light. It holds shadows and light between bodies too, as far as the twin has them; where the
        lamps' light does not come at all, it is that of the centre, and the pixel's `visibility` is 0.
        """
        info = self.frame.info.model_dump()
        buffers = {name: self.frame.buffer(name) for name in ("range", "normal", "albedo")}
        view = view_of_frame(info, buffers)
        share, lit = _reflectance_of_pixels(view, self.frame.buffer("albedo"), self.frame.buffer("water_free"))
        lit = lit & np.any(self.frame.buffer("transmission") > 0, axis=-1)
        share = np.where(lit, share, 1.0)[..., None].astype(np.float32)
        visibility = np.repeat(lit[..., None], len(view.lamps), axis=-1).astype(np.float32)
        view = replace(view, albedo=view.albedo * share, visibility=visibility)
        for value in vars(view).values():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)
        return view

    @cached_property
    def below_sensor_noise(self) -> bool:
        """Whether light from bodies drowns in nearly all pixels: below the camera's noise of one picture."""
        signal = self.layers["direct"] + self.layers["forward_scatter"]
        buried = np.all(signal < noise_std_radiance(self.radiance, **self.sensor), axis=-1)
        return bool(np.mean(buried) >= _BURIED_SHARE)

    @cached_property
    def chart(self) -> tuple[slice, slice] | None:
        """Rows and columns of the rectangle around a resolution chart, None without one."""
        numbers = [body.instance for body in self.frame.info.bodies if body.kind == _CHART]
        seen = np.isin(self.frame.buffer("instance"), numbers)
        if not seen.any():
            return None
        rows, columns = (np.flatnonzero(seen.any(axis=axis)) for axis in (1, 0))
        return slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)

    @cached_property
    def chart_groups(self) -> tuple[int, ...]:
        """USAF groups that the picture can show: line pairs per mm 2^group to 2^(group + 1). Empty without a chart."""
        if self.chart is None:
            return ()
        finest = int(np.floor(np.log2(_FINEST_CYCLES_PER_PX / self._mm_per_px)))
        size = min(part.stop - part.start for part in self.chart)
        coarsest = int(np.ceil(np.log2(contrast.LEAST_CYCLES / size / self._mm_per_px)))
        return tuple(range(coarsest, finest))

    @cached_property
    def _mm_per_px(self) -> float:
        return 1e3 * self.view.pixel_angle_rad * float(np.median(self.frame.buffer("range")[self.chart]))

    def transfer(self, light: np.ndarray, *, noisy: bool = False) -> contrast.Transfer:
        """Return the contrast transfer of light (H, W, 3) in the chart's groups; `noisy`: with the truth's noise."""
        edges = 2.0 ** np.arange(self.chart_groups[0], self.chart_groups[-1] + 2) * self._mm_per_px
        error = 0.0
        if noisy:  # bands of one pixel share their paths: their noise adds up in full
            error = linear_from_radiance(self.standard_error, **self.sensor).mean(axis=-1)[self.chart]
        reference = self.grey(self.frame.buffer("water_free"))[self.chart]
        return contrast.transfer(self.grey(light)[self.chart], reference, edges=edges, standard_error=error)

    @property
    def conditions(self) -> dict:
        """What the frame was like, in plain numbers."""
        info, water = self.frame.info, self.frame.info.water
        nearest = int(np.argmin(np.abs(np.array(water.wavelengths_nm) - _SHOWN_NM)))
        a, b = water.absorption_per_m[nearest], water.scattering_per_m[nearest]
        ranges = self.frame.buffer("range")
        range_m = float(np.median(ranges[np.isfinite(ranges)])) if np.any(np.isfinite(ranges)) else 0.0
        total = float(np.sum(self.radiance, dtype=float))
        unscattered = "direct_unscattered"
        shares = dict(self.layers)
        if unscattered in self.frame.buffer_names:
            shares |= {unscattered: self.frame.buffer(unscattered)}
            shares |= {"backscatter_single": self.frame.buffer("backscatter_single")}
        return {
            "group": info.group,
            "scene": info.scene,
            "attenuation_per_m": round(a + b, 6),
            "single_scattering_albedo": round(b / (a + b), 6) if a + b > 0 else 0.0,
            "phase": phase_name(water.phase_function),
            "range_m": round(range_m, 4),
            "optical_depth": round((a + b) * range_m, 4),
            "lamp_offset_m": round(max((self._offset_m(lamp.position_m) for lamp in info.lamps), default=0.0), 4),
            "monte_carlo_noise_percent": radiance.noise_share(
                self.grain.of(self.radiance), standard_error=self.grain.error_of(self.standard_error)
            ),
            "grain_px": self.grain.size_px,
            "left_out_percent": self.grain.left_out_percent,
            "resolution_percent": self.grain.resolution_percent,
            "samples_per_pixel": info.samples_per_pixel,
            "below_sensor_noise": self.below_sensor_noise,
            "shares": {name: float(np.sum(one, dtype=float)) / total for name, one in shares.items()},
        }

    def _offset_m(self, position_m) -> float:
        """Distance of a lamp from the camera across the optical axis."""
        pose = self.frame.world_from_camera
        local = pose[:3, :3].T @ (np.array(position_m) - pose[:3, 3])
        return float(np.hypot(*local[:2]))


def usable(frame: Frame) -> str | None:
    """Return why a frame cannot be a truth, None if it can."""
    info = frame.info
    if info.blur is not None or info.sub_frames > 1 or info.camera.readout_s > 0:
        return "motion or a rolling shutter"
    if not info.lamps:
        return "no lamp"
    if info.particles:
        return "marine snow"
    if info.options.denoised_layers:
        return "denoised"
    return None


def phase_name(record: dict) -> str:
    """Return the name of a phase function that a frame.json describes, as plots have it."""
    if record["type"] == "hg_mixture":
        g = record["g"]
        return f"Henyey-Greenstein, g = {g[0]:g}" if len(g) == 1 else f"{len(g)} Henyey-Greenstein terms"
    kinds = [term["type"] for term in record["terms"]]
    names = {"table": "measured", "fournier_forand": "Fournier-Forand", "rayleigh": "Rayleigh"}
    return " + ".join(names.get(kind, kind) for kind in dict.fromkeys(kinds))


def _reflectance_of_pixels(view: View, albedo: np.ndarray, water_free: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the pixels' mean reflectance over that of their centres, (H, W), and where it is known, (H, W) bool."""
    light = np.zeros((*view.shape, 3))
    for lamp in view.lamps:
        arriving = lamp.arriving(view.points_m)
        cosine = np.maximum(np.sum(arriving.towards * view.normals, axis=-1), 0)
        received = np.where(view.has_body, arriving.irradiance_per_intensity * cosine * view.factor / np.pi, 0)
        light += received[..., None] * band_values(view, lamp.spectrum)
    expected = (light * albedo).sum(axis=-1)
    lit = (light.sum(axis=-1) > _LIGHT * light.sum(axis=-1).max()) & (expected > 0)
    return np.where(lit, water_free.sum(axis=-1, dtype=float) / np.where(lit, expected, 1), 1.0), lit
