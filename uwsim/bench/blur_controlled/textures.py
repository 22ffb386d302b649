"""Sharp textures: pictures that come with scikit-image, and Gaussian random fields of known spectrum."""

from functools import cache

import numpy as np

from uwsim.bench.blur_controlled.protocol import Texture
from uwsim.motion_blur.spectrum import TEXTURE_TERMS, Spectrum

PICTURES = (
    "astronaut", "brick", "camera", "cat", "cell", "coffee", "coins", "grass", "gravel", "hubble_deep_field",
    "immunohistochemistry", "moon", "retina",
)  # fmt: skip
"""Those inside scikit-image's wheel, large enough, and sharp as far as pictures are."""
FIELD_MEAN = 0.5
LARGEST_CROP_PX = 384
# below, a field's spectrum is flat: a 256 px frame shows hardly more of it than a gradient
LOWEST_FREQUENCY = 3 / 256


@cache
def picture(name: str) -> np.ndarray:
    """Return a picture of scikit-image as grey (H, W) float64, 1 = white; ValueError for names not in PICTURES."""
    if name not in PICTURES:
        raise ValueError(f"picture: got {name!r}, allowed: {', '.join(PICTURES)}")
    from skimage import data

    values = getattr(data, name)() / 255.0
    grey = values if values.ndim == 2 else values[..., :3].mean(axis=-1)
    grey.setflags(write=False)
    return grey


def crop(texture: Texture, *, place: int, side_px: int, margin_px: int) -> np.ndarray:
    """Return a part of a picture with at least `margin_px` around `side_px` squared, (H, W) float64.

    place: 0 the middle, as large as the picture and 384 px allow; 1 to 4 the corners, no larger than asked for.
    ValueError if the picture is too small.
    """
    grey = picture(texture.picture)
    least = side_px + 2 * margin_px
    if min(grey.shape) < least:
        raise ValueError(f"{texture.picture}: the picture is {grey.shape} px, allowed: at least {least} px")
    # an even margin, so that the frame lies in the middle
    height, width = ((min(LARGEST_CROP_PX, side) if place == 0 else least) // 2 * 2 for side in grey.shape)
    spare_down, spare_right = grey.shape[0] - height, grey.shape[1] - width
    share = ((0.5, 0.5), (0, 0), (0, 1), (1, 0), (1, 1))[place]
    top, left = int(share[0] * spare_down), int(share[1] * spare_right)
    part = grey[top : top + height, left : left + width]
    return part.mean() + texture.contrast * (part - part.mean())


@cache
def field_spectrum(texture: Texture) -> Spectrum:
    """Return the spectrum of a Gaussian field, without noise: a power law with the field's standard deviation."""
    power = Spectrum(0.0, (0.0, texture.exponent) + (0.0,) * (TEXTURE_TERMS - 2), LOWEST_FREQUENCY)
    psd = _psd(power, LARGEST_CROP_PX)
    amplitude = texture.std**2 / psd.mean()
    return Spectrum(0.0, (float(np.log(amplitude)), *power.texture[1:]), LOWEST_FREQUENCY)


def drawn_field(texture: Texture, *, rng: np.random.Generator) -> np.ndarray:
    """Return a draw of a Gaussian field, periodic, (384, 384) float64, about FIELD_MEAN."""
    white = np.fft.fft2(rng.standard_normal((LARGEST_CROP_PX, LARGEST_CROP_PX)))
    psd = _psd(field_spectrum(texture), LARGEST_CROP_PX)
    return FIELD_MEAN + np.fft.ifft2(white * np.sqrt(psd)).real


def _psd(spectrum: Spectrum, side_px: int) -> np.ndarray:
    """Return the density on the grid of a periodic picture, nothing at frequency 0: the mean is given."""
    frequencies = np.fft.fftfreq(side_px)
    psd = spectrum.texture_psd(frequencies[None, :], frequencies[:, None])
    psd[0, 0] = 0.0
    return psd
