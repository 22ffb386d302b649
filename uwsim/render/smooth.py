"""What a frame may have on request: layers split by order of scattering, and scattered light denoised.

Denoising is biased: it takes the rare bright path, which carries the mean, for noise. What it does to a layer is
therefore measured on the very picture and stated with it. Two halves of the samples, A and B, are denoised each on its
own, and the mean of the two is kept. With f the denoiser, T the truth and < > a mean over pixels,

    < (f(A) - A) (f(B) - B) >   has the expectation  < (E f - T)^2 >,  the bias, as A and B are independent;
    < out^2 - f(A) B - f(B) A + A B >  that of  < (out - T)^2 >,  the whole error of what is kept, bias and noise.

Scattered light is smooth, and nearly all of the noise: forward scatter and backscatter on their way to the camera, and
the part of `direct` that particles sent to the body. That part is denoised as light on the body, divided by its albedo
(of a moving camera: by the albedo's mean over the exposure), which keeps the texture; what comes to the body
unscattered is never touched.

Source: Intel Open Image Denoise (package pyoidn), filter RT, for light on bodies with their normals, which are free of
noise, as auxiliary picture. The products of independent halves are those of cross-validation (Lehtinen et al. 2018,
Noise2Noise, shows that noisy targets serve for the mean).
Valid: as an estimate, which has noise of its own; a rare bright path that neither half met is in no number here.
"""

from dataclasses import dataclass
from importlib import metadata, util

import numpy as np

from uwsim.render.accumulate import Accumulator, Sums
from uwsim.render.stopping import region_means

DENOISED = ("direct", "forward_scatter", "backscatter")
"""The layers that change: of `direct`, what particles sent to the body, unless bodies move or rows are read in turn."""

PACKAGE = "pyoidn"
# of the quantities of `transport.estimate` with orders: radiance, the layers, then `integrator.ORDERS`
_DIRECT, _FORWARD_SCATTER, _BACKSCATTER, _UNSCATTERED = 1, 2, 3, 4
# of a body darker than this the light on it is not asked for
_LEAST_ALBEDO = 0.01


@dataclass(frozen=True, kw_only=True)
class Options:
    """What a frame has on request.

    orders: also `direct_unscattered` and `backscatter_single`. denoise: the layers of DENOISED denoised (biased).
    """

    orders: bool = False
    denoise: bool = False


@dataclass(frozen=True, kw_only=True)
class Bias:
    """What denoising did to a layer, relative to the layer's mean over picture and bands (of `direct`, to all of it).

    mean: of the picture's mean, signed, per band (3,). region, pixel: root mean square of the bias of the means over
    8 x 8 regions, and of single pixels; 0 where the estimate falls below 0. pixel_error: root mean square of the whole
    error of single pixels, bias and noise, after denoising; pixel_error_before: without.
    """

    mean: tuple[float, float, float]
    region: float
    pixel: float
    pixel_error: float
    pixel_error_before: float


def require_denoiser() -> None:
    """Raise ValueError with the command that installs the denoiser unless it is there."""
    if util.find_spec(PACKAGE) is None:
        raise ValueError(f"denoise: needs the package {PACKAGE}, which is not installed; type: pip install {PACKAGE}")


def denoiser_name() -> str:
    """Return the name of the denoiser with its version."""
    return f"Intel Open Image Denoise ({PACKAGE} {metadata.version(PACKAGE)})"


def denoised(layer: np.ndarray, normal: np.ndarray | None = None) -> np.ndarray:
    """Return a layer (H, W, 3) of radiance through the denoiser, float32, >= 0; `normal` (H, W, 3) of the bodies."""
    from pyoidn.denoise import denoise

    guides = {} if normal is None else {"albedo": np.ones_like(normal), "normal": normal, "clean_aux": True}
    return np.maximum(denoise(np.ascontiguousarray(layer, np.float32), hdr=True, **guides), 0)


class HalvedAccumulator(Accumulator):
    """Adds, as more quantities at the end, what is to be denoised of every other batch. Its estimate has the orders."""

    def _add(self, mean: np.ndarray) -> None:
        super()._add(np.concatenate([mean, _scattered(mean) * (self.batches % 2)]))


def _scattered(quantities: np.ndarray) -> np.ndarray:
    """Return what of the layers of DENOISED goes through the denoiser, (3, H, W, 3)."""
    on_body = quantities[_DIRECT] - quantities[_UNSCATTERED]
    return np.stack([on_body, quantities[_FORWARD_SCATTER], quantities[_BACKSCATTER]])


def whole(sums: Sums) -> Sums:
    """Return the sums of a `HalvedAccumulator` without its additions."""
    count = len(sums.sums) - len(DENOISED)
    return Sums(sums.batches, sums.sums[:count], sums.squares[:count], sums.region_sums, sums.region_squares)


def halves(sums: Sums) -> tuple[np.ndarray, np.ndarray, float]:
    """Return the scattered light of DENOISED in the even and in the odd batches, (3, H, W, 3), and the even share."""
    odd_batches = sums.batches // 2
    odd = sums.sums[-len(DENOISED) :]
    even = _scattered(sums.sums) - odd
    even_batches = sums.batches - odd_batches
    return even / even_batches, odd / odd_batches, even_batches / sums.batches


@dataclass(frozen=True, kw_only=True)
class Surfaces:
    """What is seen in the pixels of a picture, free of noise: `albedo`, 0 where no body is, and `normal`, (H, W, 3).

    Of a moving camera both are means over the exposure.
    """

    albedo: np.ndarray
    normal: np.ndarray


def denoise_layers(
    images: dict[str, np.ndarray], sums: Sums, surfaces: Surfaces | None
) -> tuple[dict[str, np.ndarray], dict[str, Bias]]:
    """Return the images with the layers of DENOISED denoised and `radiance` their sum, and the bias of each layer.

    images: of `transport.pictures` with orders; sums: of a `HalvedAccumulator`, 2 batches or more; surfaces: None where
    they are not known: `direct` then stays as it is. `standard_error` stays that of the radiance before.
    """
    even, odd, share = halves(sums)
    made, biases = dict(images), {}
    for index, name in enumerate(DENOISED):
        if name == "direct" and surfaces is None:
            continue
        through = _light_on_bodies(surfaces) if name == "direct" else denoised
        first, second = through(even[index]), through(odd[index])
        out = (share * first.astype(float) + (1 - share) * second).astype(np.float32)
        biases[name] = _bias(even[index], odd[index], first, second, share, layer=images[name])
        made[name] = images["direct_unscattered"] + out if name == "direct" else out
    made["radiance"] = made["direct"] + made["forward_scatter"] + made["backscatter"]
    return made, biases


def _light_on_bodies(surfaces: Surfaces):
    """Return the filter of light that bodies send on: through the denoiser as the light that they receive."""
    albedo = np.where(surfaces.albedo > _LEAST_ALBEDO, surfaces.albedo, 1).astype(np.float32)
    return lambda layer: denoised(layer / albedo, surfaces.normal) * albedo


def _bias(
    even: np.ndarray, odd: np.ndarray, first: np.ndarray, second: np.ndarray, share: float, *, layer: np.ndarray
) -> Bias:
    """Return the bias of share f(A) + (1 - share) f(B) from `even` A, `odd` B, f(A) and f(B), relative to `layer`."""
    out = share * first + (1 - share) * second
    before = share * even + (1 - share) * odd
    scale = float(layer.mean(dtype=float))
    if scale <= 0:
        return Bias(mean=(0.0, 0.0, 0.0), region=0.0, pixel=0.0, pixel_error=0.0, pixel_error_before=0.0)
    band = layer.mean(axis=(0, 1), dtype=float)
    # the means of the two halves differ in their noise, their changes do not
    change = (out - before).mean(axis=(0, 1))
    mean = np.divide(change, band, out=np.zeros(3), where=band > 0)
    regions = region_means(first - even) * region_means(second - odd)
    pixels = (first - even) * (second - odd)
    # truth times out: each half denoised times the other, which is independent of it
    product = share * first * odd + (1 - share) * second * even
    error = out**2 - 2 * product + even * odd
    return Bias(
        mean=tuple(mean.tolist()),
        region=_root(regions) / scale,
        pixel=_root(pixels) / scale,
        pixel_error=_root(error) / scale,
        pixel_error_before=_root(before**2 - even * odd) / scale,
    )


def _root(squares: np.ndarray) -> float:
    return float(np.sqrt(max(float(squares.mean()), 0.0)))
