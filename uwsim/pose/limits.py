"""What the numbers of a layout's design may be: wide enough for any target and camera, and all that follows finite."""

from typing import NamedTuple


class Limits(NamedTuple):
    """From `least` to `most`, both allowed, in `unit`."""

    least: float
    most: float
    unit: str = ""

    def __str__(self) -> str:
        whole = isinstance(self.most, int)
        ends = (str(end) if whole else f"{end:g}" for end in (self.least, self.most))
        return f"{' to '.join(ends)} {self.unit}".rstrip()

    def check(self, value: float, *, name: str) -> None:
        """ValueError for a value outside, and for NaN."""
        if not self.least <= value <= self.most:
            raise ValueError(f"{name}: got {value}{f' {self.unit}' * bool(self.unit)}, allowed: {self}")


SIZE_M = Limits(1e-6, 1e3, "m")
DISTANCE_M = Limits(1e-3, 1e4, "m")
TILT_DEG = Limits(0.0, 90.0, "deg")
NOISE_PX = Limits(1e-6, 1e3, "px")
FOV_DEG = Limits(0.1, 170.0, "deg")
FOCAL_PX = Limits(1.0, 1e7, "px")
TRIALS = Limits(0, 10_000)
SEED = Limits(0, 2**63 - 1)
