"""When a picture is good enough: two measures of its Monte-Carlo noise, and the rules that end a render.

Region error: of the means over 8 x 8 regions, relative; what averages over an area see.
Pixel ratio: of single pixels, relative to the sensor's own temporal noise; what the picture's user sees.

Both come from independent batches, every batch with the same number of samples. The rules are asked after fixed
numbers of batches only, so that a render ends at the same one whenever it is made again.
"""

import re
from dataclasses import dataclass

import numpy as np

REGIONS = 8  # rows and columns of regions
PERCENTILE = 95.0  # of the regions in all bands
PIXEL_RATIO = 0.5  # of the sensor's noise
PIXEL_SHARE = 0.95  # of the pixels
LEAST_BATCHES = 8  # before a rule may end a render: a spread over fewer says little
SAMPLES_PER_BATCH = 16  # where a rule ends the render

_RULES_GIVEN = "give samples_per_pixel with batches, or a noise rule or a time"


@dataclass(frozen=True, kw_only=True)
class Noise:
    """Monte-Carlo noise of a picture after `batches`.

    region_error_p95: 95th percentile over regions and bands of the relative standard error of the region's mean.
    pixel_ratio_p95: 95th percentile over pixels of the largest of the bands' `pixel_ratio`.
    pixel_share_within: share of the pixels in which no band's ratio exceeds 0.5.
    """

    batches: int
    region_error_p95: float
    pixel_ratio_p95: float
    pixel_share_within: float

    @property
    def pixel_rule_met(self) -> bool:
        return self.pixel_share_within >= PIXEL_SHARE

    def region_rule_met(self, region: float) -> bool:
        return self.region_error_p95 <= region


@dataclass(frozen=True, kw_only=True)
class Until:
    """What ends the render of a picture, whichever comes first.

    batches: so many batches. region: both rules hold, the region rule at this value; without `pixels` that one alone.
    time_s: the wall time of the whole frame is up (at least 2 batches of each picture are rendered all the same).
    Raises ValueError on impossible values, and if nothing ends the render.
    """

    samples_per_batch: int = SAMPLES_PER_BATCH
    batches: int | None = None
    region: float | None = None
    pixels: bool = True
    time_s: float | None = None

    def __post_init__(self):
        if self.batches is None and self.region is None and self.time_s is None:
            raise ValueError(f"stopping: got nothing that ends the render, allowed: {_RULES_GIVEN}")
        if self.samples_per_batch < 1 or (self.batches is not None and self.batches < 2):
            raise ValueError(
                f"batches: got {self.batches} of {self.samples_per_batch} samples, allowed: at least 2 of at least 1"
            )
        if self.region is not None and not 1e-4 <= self.region <= 0.5:
            raise ValueError(f"region error: got {self.region}, allowed: 0.0001 to 0.5 (0.01 % to 50 %)")
        if self.time_s is not None and not 0 < self.time_s < float("inf"):
            raise ValueError(f"time: got {self.time_s} s, allowed: above 0")

    def holds(self, noise: Noise) -> bool:
        """Whether the rules hold that are to end the render; False where none is asked for."""
        if self.region is None or not noise.region_rule_met(self.region):
            return False
        return noise.pixel_rule_met or not self.pixels

    def expected_batches(self, noise: Noise | None) -> int | None:
        """Return the number of batches at which the render should end, None where only time ends it.

        From the errors found so far, that fall with the square root of the samples, on to the next check.
        """
        if self.region is None:
            return self.batches
        needed = LEAST_BATCHES
        if noise is not None and not self.holds(noise):
            factor = (noise.region_error_p95 / self.region) ** 2
            if self.pixels and not noise.pixel_rule_met:
                factor = max(factor, (noise.pixel_ratio_p95 / PIXEL_RATIO) ** 2)
            needed = next_check(max(noise.batches + 1, int(np.ceil(min(noise.batches * factor, 1e9)))))
        return needed if self.batches is None else min(needed, self.batches)


def until(samples_per_pixel: int | None, batches: int | None, rule: Until | None) -> Until:
    """Return `rule`, or what ends a render after samples in equal batches; exactly one of the two is given.

    Raises ValueError otherwise, and unless the samples can be split into at least 2 equal batches.
    """
    if (rule is None) != (samples_per_pixel is not None) or (samples_per_pixel is None) != (batches is None):
        raise ValueError(f"samples_per_pixel {samples_per_pixel}, batches {batches}, until {rule}: {_RULES_GIVEN}")
    if rule is not None:
        return rule
    check_samples(samples_per_pixel, batches)
    return Until(samples_per_batch=samples_per_pixel // batches, batches=batches)


def check_samples(samples_per_pixel: int, batches: int) -> None:
    """Raise ValueError unless the samples can be split into at least 2 equal batches."""
    if batches < 2 or samples_per_pixel < batches or samples_per_pixel % batches:
        raise ValueError(
            f"samples_per_pixel: got {samples_per_pixel} in {batches} batches, "
            "allowed: a multiple of the batches, at least 2 of them"
        )


def most_batches(max_samples: int, samples_per_batch: int = SAMPLES_PER_BATCH) -> int:
    """Return the batches in `max_samples`; ValueError unless they are whole and enough for a rule to be asked."""
    if max_samples % samples_per_batch or max_samples < LEAST_BATCHES * samples_per_batch:
        raise ValueError(
            f"max_samples: got {max_samples}, allowed: a multiple of samples_per_batch = {samples_per_batch}, "
            f"at least {LEAST_BATCHES * samples_per_batch}"
        )
    return max_samples // samples_per_batch


def next_check(batches: int) -> int:
    """Return the first number of batches, not below `batches`, at which the rules are asked: 8, 10, 13, 17, 22 ...

    Each is a quarter more than the one before, rounded up: a render has at most a quarter more samples than it needs,
    and the rules are asked so seldom that they are not met by luck.
    """
    check = LEAST_BATCHES
    while check < batches:
        check += (check + 3) // 4
    return check


def region_means(image: np.ndarray) -> np.ndarray:
    """Return the means of an image (H, W, C) over a grid of 8 x 8 regions, (8, 8, C), top row first.

    Region i of n pixels begins at pixel i n // 8; an image of fewer than 8 rows or columns has one region for each.
    """
    rows, columns = _starts(image.shape[0]), _starts(image.shape[1])
    sums = np.add.reduceat(np.add.reduceat(image, rows, axis=0), columns, axis=1)
    sizes = np.outer(np.diff(rows, append=image.shape[0]), np.diff(columns, append=image.shape[1]))
    return sums / sizes[..., None]


def _starts(length: int) -> np.ndarray:
    count = min(REGIONS, length)
    return np.arange(count) * length // count


def region_error(sums: np.ndarray, squares: np.ndarray, *, batches: int, dark: np.ndarray) -> float:
    """Return the 95th percentile, over regions and bands, of the relative standard error of the region's mean.

    sums, squares: of `region_means` of each batch, and of their squares, (rows, columns, bands).
    dark: radiance that equals the sensor's noise without light, (bands,) or as `sums`. The error of a region darker
    than this is taken relative to it: where the whole region lies below the noise of a single pixel, one percent of
    its mean is nothing that any picture holds, and it would keep the render from ending. At a target of 1 % such a
    region's error is 1 % of that noise, less than the sensor's own error in the mean of a region of up to 10^4 pixels.
    """
    mean = sums / batches
    error = np.sqrt(np.maximum(squares / batches - mean**2, 0) / (batches - 1))
    scale = np.broadcast_to(np.maximum(mean, dark), error.shape)
    relative = np.divide(error, scale, out=np.zeros_like(error), where=scale > 0)  # black and a sensor without noise
    return float(np.percentile(relative, PERCENTILE))


def pixel_ratio(standard_error: np.ndarray, sensor_noise: np.ndarray) -> np.ndarray:
    """Return the Monte-Carlo standard error of pixels relative to the sensor's temporal noise, (H, W, bands).

    Both (H, W, bands) in radiance, as `camera.sensor.noise_std_radiance` gives the noise. The root mean square over
    the 3 x 3 pixels around each (those inside the image): a spread over few batches is itself noisy, by a quarter over
    8 of them, so that single pixels would fail the rule by bad luck until they have nearly half as many samples again,
    and pass it by good luck where the rare bright path has not yet come.
    """
    squared = np.square(np.asarray(standard_error, dtype=float))
    variance = np.square(np.asarray(sensor_noise, dtype=float))
    no_noise = np.where(squared > 0, np.inf, 0.0)
    return np.sqrt(_mean_3x3(np.divide(squared, variance, out=no_noise, where=variance > 0)))


def _mean_3x3(image: np.ndarray) -> np.ndarray:
    height, width = image.shape[:2]
    padded = np.pad(image, ((1, 1), (1, 1), (0, 0)))
    inside = np.pad(np.ones((height, width, 1)), ((1, 1), (1, 1), (0, 0)))
    shifts = [(slice(i, i + height), slice(j, j + width)) for i in range(3) for j in range(3)]
    return sum(padded[shift] for shift in shifts) / sum(inside[shift] for shift in shifts)


def share_within(ratio: np.ndarray) -> float:
    """Return the share of the pixels in which no band of `pixel_ratio` exceeds 0.5."""
    return float(np.mean(ratio.max(axis=-1) <= PIXEL_RATIO))


def measure(
    *, region_sums: np.ndarray, region_squares: np.ndarray, batches: int, standard_error: np.ndarray,
    sensor_noise: np.ndarray, dark: np.ndarray,
) -> Noise:  # fmt: skip
    """Return the noise of a picture; see `region_error` and `pixel_ratio` for the arguments."""
    ratio = pixel_ratio(standard_error, sensor_noise)
    return Noise(
        batches=batches,
        region_error_p95=region_error(region_sums, region_squares, batches=batches, dark=dark),
        pixel_ratio_p95=float(np.percentile(ratio.max(axis=-1), PERCENTILE, method="higher")),
        pixel_share_within=share_within(ratio),
    )


def share_from_text(text: str) -> float:
    """Return a share such as "1%" or "0.01"; ValueError in one line."""
    match = re.fullmatch(r"\s*(\d*\.?\d+)\s*(%?)\s*", text)
    value = float(match[1]) / (100 if match[2] else 1) if match else float("nan")
    if not 1e-4 <= value <= 0.5:
        raise ValueError(f"--noise: got {text!r}, allowed: a share from 0.01% to 50% such as 1% or 0.01")
    return value


def seconds_from_text(text: str) -> float:
    """Return a duration such as "60s", "5m" or "1.5h" in seconds; ValueError in one line."""
    match = re.fullmatch(r"\s*(\d*\.?\d+)\s*([smh])\s*", text)
    value = float(match[1]) * {"s": 1, "m": 60, "h": 3600}[match[2]] if match else 0.0
    if value <= 0:
        raise ValueError(f"--time: got {text!r}, allowed: a time above 0 with its unit such as 60s, 5m or 2h")
    return value
