"""Pictures put together from several by weights, at every scale by its own.

Source: Burt, Adelson, "The Laplacian pyramid as a compact image code", IEEE Trans. Communications 31(4), 1983; fusion
by Gaussian pyramids of the weights: Mertens, Kautz, Van Reeth, "Exposure fusion", Pacific Graphics 2007.
"""

import numpy as np


def gaussian(image: np.ndarray, levels: int) -> list[np.ndarray]:
    """Return the image (H, W) or (H, W, C) float32 and `levels` - 1 halvings of it."""
    import cv2

    found = [image]
    for _ in range(levels - 1):
        found.append(cv2.pyrDown(found[-1]))
    return found


def laplacian(image: np.ndarray, levels: int) -> list[np.ndarray]:
    """Return what each level of the Gaussian pyramid has beyond the next, and the last level itself."""
    steps = gaussian(image, levels)
    return [fine - _enlarged(coarse, fine) for fine, coarse in zip(steps[:-1], steps[1:], strict=True)] + steps[-1:]


def collapsed(steps: list[np.ndarray]) -> np.ndarray:
    """Return the image of a Laplacian pyramid."""
    image = steps[-1]
    for fine in reversed(steps[:-1]):
        image = _enlarged(image, fine) + fine
    return image


def fused(images: list[np.ndarray], weights: list[np.ndarray]) -> np.ndarray:
    """Return the fusion (H, W, C) of images (H, W, C) float32 by weights (H, W) that sum to 1 in every pixel."""
    height, width = images[0].shape[:2]
    levels = max(1, int(np.log2(min(height, width))) - 2)
    total = None
    for image, weight in zip(images, weights, strict=True):
        parts = [
            step * share[..., None]
            for step, share in zip(laplacian(image, levels), gaussian(weight, levels), strict=True)
        ]
        total = parts if total is None else [a + b for a, b in zip(total, parts, strict=True)]
    return collapsed(total)


def _enlarged(coarse: np.ndarray, like: np.ndarray) -> np.ndarray:
    import cv2

    return cv2.pyrUp(coarse, dstsize=like.shape[1::-1])
