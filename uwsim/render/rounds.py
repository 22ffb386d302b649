"""The light pictures of one frame, rendered batch by batch until a rule ends each."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from uwsim.camera import sensor
from uwsim.render import smooth, stopping, transport
from uwsim.render.accumulate import Accumulator, Sums
from uwsim.render.checkpoint import Checkpoint
from uwsim.render.film import View
from uwsim.scene import truth
from uwsim.scene.models import Scene

Progress = Callable[[str, int, int], None]
# Where time ends the render, a picture through water gets this much more of it than one without.
_TIME_IN_WATER = 3.0
_TIME_WITHOUT_WATER = 1.0
_LEAST_BATCHES_IN_TIME = 2  # a standard error needs two


@dataclass(frozen=True, kw_only=True)
class Ended:
    """How the render of a picture ended: its noise, which of "samples", "noise" and "time" ended it, and the bias of
    its layers that were denoised.

    samples_per_pixel: in all; more than asked for where moving bodies need more sub-frames than a batch has samples.
    """

    noise: stopping.Noise
    by: str
    samples_per_pixel: int
    bias: dict[str, smooth.Bias] = field(default_factory=dict)


_NOTHING_MORE = smooth.Options()


class Rounds:
    """Renders the pictures of a frame, each until `until` ends it, and keeps how they ended in `ended`.

    until: the noise rules are applied to every picture: twins are truth too. Its time is for all pictures together:
    shared among those still to come, in water three times as much as without.
    names: of the pictures, in the order in which they will be asked for.
    checkpoint: where sums are taken from and kept. Raises ValueError if it holds more batches than asked for.
    progress: called with (what is being done, launches done, launches expected).
    options: `orders` for the picture "radiance", `denoise` for those in water; rules hold or not before denoising.
    """

    def __init__(
        self, scene: Scene, view: View, until: stopping.Until, *, names: tuple[str, ...],
        checkpoint: Checkpoint | None = None, progress: Progress | None = None,
        options: smooth.Options = _NOTHING_MORE,
    ):  # fmt: skip
        self.scene, self.view, self.until, self.options = scene, view, until, options
        self.checkpoint, self.progress = checkpoint, progress
        self.ended: dict[str, Ended] = {}
        self._weights = {name: _TIME_WITHOUT_WATER if name == "water_free" else _TIME_IN_WATER for name in names}
        self._started_s = time.monotonic()
        self._constants: dict | None = None

    def picture(
        self, name: str, built, *, seed: int, view: View | None = None, surfaces: smooth.Surfaces | None = None
    ) -> dict[str, np.ndarray]:
        """Return the images of `transport.layers`, rendered until a rule ends it; `view`: another than the frame's.

        `surfaces`: what its pixels see, for the denoiser; None where that is not known.
        """
        from uwsim.render.integrator import ORDERS

        stored = self.checkpoint and self.checkpoint.sums(name)
        denoise, orders = self.options.denoise and name != "water_free", self.options.orders and name == "radiance"
        kind = smooth.HalvedAccumulator if denoise else Accumulator
        accumulator = kind(
            built, view or self.view, transport.estimate(built, orders=denoise or orders),
            samples_per_batch=self.until.samples_per_batch, seed=seed, sums=stored,
        )  # fmt: skip
        if self.until.batches is not None and accumulator.batches > self.until.batches:
            raise ValueError(
                f"checkpoint {self.checkpoint.path}: holds {accumulator.batches} batches of {name}, "
                f"allowed: at most the {self.until.batches} asked for"
            )
        clock = _Clock(self._seconds_for(name))
        noise = None
        while True:
            if self._is_check(accumulator.batches):
                noise = self._noise(name, accumulator.sums, _images(accumulator.sums, denoise))
            by = self._end(accumulator.batches, noise, clock)
            if self.checkpoint is not None and accumulator.batches:
                self.checkpoint.store(name, accumulator.sums, now=by is not None)
            if by is not None:
                break
            accumulator.add_batch(self._reporter(name, accumulator, noise, clock))
            clock.lap()
        images, bias = _images(accumulator.sums, denoise), {}
        if denoise:
            images, bias = smooth.denoise_layers(images, accumulator.sums, surfaces)
            images = images if orders else {key: image for key, image in images.items() if key not in ORDERS}
        self.ended[name] = Ended(
            noise=self._noise(name, accumulator.sums, images),
            by=by,
            bias=bias,
            samples_per_pixel=accumulator.batches * accumulator.samples_per_batch,
        )
        return images

    def _is_check(self, batches: int) -> bool:
        return self.until.region is not None and batches > 0 and stopping.next_check(batches) == batches

    def _end(self, batches: int, noise: stopping.Noise | None, clock: "_Clock") -> str | None:
        """Return what ends the render after so many batches, None if nothing does."""
        if noise is not None and noise.batches == batches and self.until.holds(noise):
            return "noise"
        if batches == self.until.batches:
            return "samples"
        return "time" if batches >= _LEAST_BATCHES_IN_TIME and clock.is_up() else None

    def _noise(self, name: str, sums: Sums, images: dict[str, np.ndarray]) -> stopping.Noise:
        if name == "radiance" or self._constants is None:
            # the twins are exposed as the picture is
            exposed, _ = truth.auto_exposed(self.scene, images["radiance"])
            self._constants = truth.sensor_constants(exposed)
        return noise_of(images["radiance"], images["standard_error"], sums, self._constants)

    def _seconds_for(self, name: str) -> float | None:
        """Return the wall time that a picture may take: its share of what is left."""
        if self.until.time_s is None:
            return None
        to_come = {other: weight for other, weight in self._weights.items() if other not in self.ended}
        left_s = self.until.time_s - (time.monotonic() - self._started_s)
        return left_s * self._weights[name] / sum(to_come.values())

    def _reporter(self, name: str, accumulator: Accumulator, noise: stopping.Noise | None, clock: "_Clock"):
        if self.progress is None:
            return None
        launches, done = len(accumulator.launches), accumulator.batches * len(accumulator.launches)
        expected = _expected(self.until, noise, accumulator.batches, clock)
        what = name if self.until.region is None or noise is None else f"{name}: {_as_text(noise, self.until.region)}"

        def report():
            nonlocal done
            done += 1
            self.progress(what, done, max(done, expected * launches))

        return report


def _images(sums: Sums, halved: bool) -> dict[str, np.ndarray]:
    return transport.pictures(smooth.whole(sums) if halved else sums)


class _Clock:
    """Wall time of a picture, batch by batch, against the seconds that it may take (None: any)."""

    def __init__(self, limit_s: float | None):
        self.limit_s, self.started_s, self.laps = limit_s, time.monotonic(), 0
        self._last_s, self._lap_s = self.started_s, 0.0

    def lap(self) -> None:
        now_s = time.monotonic()
        self._lap_s, self._last_s, self.laps = now_s - self._last_s, now_s, self.laps + 1

    def is_up(self) -> bool:
        """Whether one more batch like the last would end after the time."""
        return self.limit_s is not None and time.monotonic() - self.started_s + self._lap_s > self.limit_s

    def batches_in_time(self) -> int | None:
        """Return how many more batches the rest of the time holds at the pace of the last, None if not known."""
        if self.limit_s is None or not self.laps:
            return None
        return max(0, int((self.limit_s - (time.monotonic() - self.started_s)) / max(self._lap_s, 1e-6)))


def _expected(until: stopping.Until, noise: stopping.Noise | None, batches: int, clock: _Clock) -> int:
    """Return at how many batches the render should end, by what is known."""
    in_time = clock.batches_in_time()
    bounds = [until.expected_batches(noise), None if in_time is None else batches + in_time]
    return min((bound for bound in bounds if bound is not None), default=stopping.LEAST_BATCHES)


def _as_text(noise: stopping.Noise, region: float) -> str:
    return f"region error {noise.region_error_p95:.2%} of {region:.2%}, pixels {noise.pixel_share_within:.0%}"


def noise_of(radiance: np.ndarray, standard_error: np.ndarray, sums: Sums, constants: dict) -> stopping.Noise:
    """Return the noise of a picture (H, W, 3) with its standard error, before a sensor of `camera.sensor` keywords."""
    dark = sensor.noise_std_radiance(np.zeros_like(radiance), **constants)
    return stopping.measure(
        region_sums=sums.region_sums, region_squares=sums.region_squares, batches=sums.batches,
        standard_error=standard_error, dark=stopping.region_means(dark),
        sensor_noise=sensor.noise_std_radiance(radiance, **constants),
    )  # fmt: skip
