"""A picture of known noise without it: small in blocks of its cosine transform is what noise alone explains.

Blocks that overlap are transformed; of their terms those above 2.7 standard deviations of the noise make a first
picture, whose own terms say how far each of the noisy ones can be believed, P / (P + noise). Edges and texture stay,
which means over windows would blur.

Source: Yu and Sapiro, "DCT image denoising: a simple and effective image denoising algorithm", Image Processing On Line
1, 2011; the second step: Dabov, Foi, Katkovnik and Egiazarian, IEEE Trans. Image Processing 16(8), 2007, section IV.
"""

import numpy as np

BLOCK_PX = 16
_STRIDE_PX = 4
# of noise alone 0.7 % of the terms are above
_THRESHOLD = 2.7
# grey and two differences: colours share most of their detail
_OPPONENT = np.array([[1, 1, 1], [1, 0, -1], [1, -2, 1]], np.float32)
_OPPONENT /= np.linalg.norm(_OPPONENT, axis=1, keepdims=True)


def denoised(image: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """Return an image (H, W, 3) float32 less its noise, independent and of a variance (H, W, 3) > 0.

    Within a block the variance is taken to be about the same: it is smoothed. Raises ValueError if shapes differ, for a
    variance not above 0, and values that are not finite.
    """
    import cv2

    if np.shape(image) != np.shape(variance) or np.ndim(image) != 3 or np.shape(image)[2] != 3:
        raise ValueError(f"denoised: image {np.shape(image)}, variance {np.shape(variance)}, allowed: both (H, W, 3)")
    if not (np.all(np.isfinite(image)) and np.all(np.isfinite(variance)) and np.min(variance) > 0):
        raise ValueError("denoised: image or variance not finite, or variance not above 0, allowed: finite, above 0")
    deviation = np.sqrt(cv2.GaussianBlur(np.asarray(variance, np.float32), (0, 0), BLOCK_PX / 2))
    apart = (image / deviation).astype(np.float32) @ _OPPONENT.T
    return np.dstack([_without_noise(apart[..., k]) for k in range(3)]) @ _OPPONENT * deviation


def _without_noise(values: np.ndarray) -> np.ndarray:
    """Return values (H, W) less their noise of variance 1."""
    height, width = values.shape
    rows, columns = (BLOCK_PX + (-side) % _STRIDE_PX for side in values.shape)
    padded = np.pad(values, ((BLOCK_PX, rows), (BLOCK_PX, columns)), mode="symmetric")
    terms = _terms(padded)
    kept = np.abs(terms) > _THRESHOLD
    kept[..., 0, 0] = True
    first = _picture(terms * kept, 1 / kept.sum(axis=(-2, -1)), padded.shape)
    power = np.square(_terms(first))
    share = power / (power + 1)
    share[..., 0, 0] = 1
    second = _picture(terms * share, 1 / np.square(share).sum(axis=(-2, -1)), padded.shape)
    return second[BLOCK_PX : BLOCK_PX + height, BLOCK_PX : BLOCK_PX + width]


def _terms(values: np.ndarray) -> np.ndarray:
    """Return the cosine transforms of the blocks that begin at every fourth pixel, (rows, columns, 16, 16)."""
    from scipy.fft import dctn

    blocks = np.lib.stride_tricks.sliding_window_view(values, (BLOCK_PX, BLOCK_PX))[::_STRIDE_PX, ::_STRIDE_PX]
    return dctn(blocks, axes=(-2, -1), norm="ortho")


def _picture(terms: np.ndarray, weights: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Return the mean (H, W) of all blocks over each pixel, weighted: the less noise a block kept, the more."""
    from scipy.fft import idctn

    blocks = idctn(terms, axes=(-2, -1), norm="ortho", overwrite_x=True) * weights[..., None, None]
    total, weight = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    rows, columns = (_STRIDE_PX * count for count in weights.shape)
    for row in range(BLOCK_PX):
        for column in range(BLOCK_PX):
            here = np.s_[row : row + rows : _STRIDE_PX, column : column + columns : _STRIDE_PX]
            total[here] += blocks[..., row, column]
            weight[here] += weights
    return total / weight
