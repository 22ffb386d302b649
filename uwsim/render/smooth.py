"""What a frame may have on request: layers split by order of scattering, and the smooth layers denoised.

Denoising is biased: it takes the rare bright path, which carries the mean, for noise. What it does to a layer is
therefore measured on the very picture and stated with it. Two halves of the samples, A and B, are denoised each on its
own, and the mean of the two is kept. With f the denoiser, T the truth and < > a mean over pixels,

    < (f(A) - A) (f(B) - B) >   has the expectation  < (E f - T)^2 >,  the bias, as A and B are independent;
    < out^2 - f(A) B - f(B) A + A B >  that of  < (out - T)^2 >,  the whole error of what is kept, bias and noise.

Source: Intel Open Image Denoise (package pyoidn), filter RT without auxiliary pictures. The products of independent
halves are those of cross-validation (Lehtinen et al. 2018, Noise2Noise, shows that noisy targets serve for the mean).
Valid: as an estimate, which has noise of its own; a rare bright path that neither half met is in no number here.
"""

from dataclasses import dataclass
from importlib import metadata, util

import numpy as np

from uwsim.render.accumulate import Accumulator, Sums
from uwsim.render.stopping import region_means

DENOISED = ("forward_scatter", "backscatter")
"""Layers of which most light was scattered more than once; `direct` holds the edges and is never touched."""

PACKAGE = "pyoidn"
_FIRST_LAYER = 1  # of the quantities of `transport.estimate`: radiance, then direct and the layers of DENOISED
_DENOISED_AT = (_FIRST_LAYER + 1, _FIRST_LAYER + 2)


@dataclass(frozen=True, kw_only=True)
class Options:
    """What a frame has on request.

    orders: also `direct_unscattered` and `backscatter_single`. denoise: the layers of DENOISED denoised (biased).
    """

    orders: bool = False
    denoise: bool = False


@dataclass(frozen=True, kw_only=True)
class Bias:
    """What denoising did to a layer, relative to the layer's mean over picture and bands.

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


def denoised(layer: np.ndarray) -> np.ndarray:
    """Return a layer (H, W, 3) of radiance through the denoiser, float32, >= 0."""
    from pyoidn.denoise import denoise

    return np.maximum(denoise(np.ascontiguousarray(layer, np.float32), hdr=True), 0)


class HalvedAccumulator(Accumulator):
    """Adds, as two more quantities at the end, the layers of DENOISED of every other batch."""

    def _add(self, mean: np.ndarray) -> None:
        half = mean[list(_DENOISED_AT)] * (self.batches % 2)
        super()._add(np.concatenate([mean, half]))


def whole(sums: Sums) -> Sums:
    """Return the sums of a `HalvedAccumulator` without its additions."""
    count = len(sums.sums) - len(DENOISED)
    return Sums(sums.batches, sums.sums[:count], sums.squares[:count], sums.region_sums, sums.region_squares)


def halves(sums: Sums) -> tuple[np.ndarray, np.ndarray, float]:
    """Return the layers of DENOISED from the even and from the odd batches, (2, H, W, 3) each, and the share of the
    even batches."""
    odd_batches = sums.batches // 2
    odd = sums.sums[-len(DENOISED) :]
    even = sums.sums[list(_DENOISED_AT)] - odd
    even_batches = sums.batches - odd_batches
    return even / even_batches, odd / odd_batches, even_batches / sums.batches


def denoise_layers(images: dict[str, np.ndarray], sums: Sums) -> tuple[dict[str, np.ndarray], dict[str, Bias]]:
    """Return the images with the layers of DENOISED denoised and `radiance` their sum, and the bias of each layer.

    images: of `transport.pictures`; sums: of a `HalvedAccumulator`, at least 2 batches. `standard_error` stays that of
    the radiance before.
    """
    even, odd, share = halves(sums)
    made, biases = dict(images), {}
    for index, name in enumerate(DENOISED):
        first, second = denoised(even[index]), denoised(odd[index])
        out = share * first.astype(float) + (1 - share) * second
        biases[name] = _bias(even[index], odd[index], first, second, share)
        made[name] = out.astype(np.float32)
    made["radiance"] = made["direct"] + made["forward_scatter"] + made["backscatter"]
    return made, biases


def _bias(even: np.ndarray, odd: np.ndarray, first: np.ndarray, second: np.ndarray, share: float) -> Bias:
    """Return the bias of share f(A) + (1 - share) f(B) from A, B (`even`, `odd`) and f(A), f(B)."""
    out = share * first + (1 - share) * second
    before = share * even + (1 - share) * odd
    scale = float(before.mean())
    if scale <= 0:
        return Bias(mean=(0.0, 0.0, 0.0), region=0.0, pixel=0.0, pixel_error=0.0, pixel_error_before=0.0)
    band = before.mean(axis=(0, 1))
    # the means of the two halves differ in their noise, their changes do not
    mean = np.divide(out.mean(axis=(0, 1)), band, out=np.ones(3), where=band > 0) - 1
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
