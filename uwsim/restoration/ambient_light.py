"""The light that the water itself sends to the camera, estimated from a single picture."""

import numpy as np

# of the pixels, those whose dark channel is highest
SHARE = 0.001


def from_dark_channel(image: np.ndarray, dark: np.ndarray, *, share: float = SHARE) -> np.ndarray:
    """Return the ambient light (3,) float64 in the units of the image (H, W, 3): its mean where `dark` is highest.

    `dark` (H, W): the dark channel, or another map that is high where water covers the scene most; `share` of the
    pixels, at least one, are averaged (ties go on in, so that equal pixels count equally). ValueError on other shapes,
    NaN, or a share outside (0, 1].

    Source: He, Sun, Tang, IEEE Trans. PAMI 33(12), 2011, section 4.3; the dissertation, eq. 3.9, takes the mean.
    Errata: eq. 3.9 prints max(I(i)) over the channels, which gives every channel the same light and leaves nothing to
    correct in eq. 3.10; here I^c(i), channel by channel.
    """
    chosen = brightest(dark, image, share=share)
    return image[chosen].mean(axis=0, dtype=np.float64)


def brightest(dark: np.ndarray, image: np.ndarray, *, share: float = SHARE) -> np.ndarray:
    """Return the mask (H, W) of the `share` of pixels of `image` (H, W, 3) whose `dark` (H, W) is highest."""
    if np.ndim(dark) != 2 or np.shape(image) != (*np.shape(dark), 3):
        raise ValueError(
            f"ambient light: image {np.shape(image)}, dark channel {np.shape(dark)}, allowed: (H, W, 3), (H, W)"
        )
    if not 0 < share <= 1:
        raise ValueError(f"ambient light: share = {share}, allowed: above 0, at most 1")
    if not np.isfinite(dark).all():
        raise ValueError("ambient light: the dark channel has NaN or infinity, allowed: finite")
    count = max(1, round(share * dark.size))
    limit = np.partition(dark.ravel(), dark.size - count)[dark.size - count]
    return dark >= limit
