"""Pose problems with outliers, made when asked for: each setting from named random streams, so also each alone."""

import hashlib
import json
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uwsim import seeds
from uwsim.bench.pnp.settings import Batch
from uwsim.bench.pnp_outliers.protocol import Outliers, Part
from uwsim.pose import problems
from uwsim.pose.problems import Placed

FIELD = 0.5
"""Images of outliers lie within +-FIELD on the plane z = 1."""
_FLAT_M = 0.3


@dataclass(frozen=True)
class Setting:
    """One share of outliers of a part; all its problems are scored together."""

    part_name: str
    part: Part
    percent: float
    trials: int

    @property
    def name(self) -> str:
        return f"{self.part_name}/{self.percent:g} %"

    @property
    def outliers(self) -> int:
        return self.part.count(self.percent)


@dataclass(frozen=True)
class Spoilt:
    """Problems as solvers get them, and which of their points are good (B, n)."""

    batch: Batch
    inliers: np.ndarray

    @cached_property
    def good(self) -> Batch:
        """The problems of the good points alone."""
        placed, count = self.batch.placed, len(self.inliers)
        return Batch(
            placed._replace(points_m=placed.points_m[self.inliers].reshape(count, -1, 3)),
            self.batch.points[self.inliers].reshape(count, -1, 2),
        )


@dataclass(frozen=True)
class Problems:
    """The problems of a protocol; they stand for a dataset: `name`, `seed`, `sha256`."""

    protocol: Outliers
    quick: bool

    name = "made while it runs"

    @property
    def seed(self) -> int:
        return self.protocol.seed

    @property
    def noise(self) -> float:
        """Standard deviation of the good points' image coordinates on the plane z = 1."""
        return self.protocol.noise_px / self.protocol.focal_px

    @property
    def threshold(self) -> float:
        """Distance on the plane z = 1 from which on solvers are told that a point is an outlier."""
        return self.protocol.threshold_std * self.noise

    @cached_property
    def sha256(self) -> str:
        """Hash of the protocol."""
        text = json.dumps(self.protocol.model_dump(mode="json"), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()

    @cached_property
    def settings(self) -> dict[str, Setting]:
        """Name -> setting, in the order of the protocol."""
        found = {}
        for name, part in self.protocol.parts.items():
            shares = (part.quick_outliers_percent or ()) if self.quick else part.outliers_percent
            for percent in shares:
                trials = self.protocol.quick_trials if self.quick else self.protocol.trials
                setting = Setting(name, part, percent, trials)
                found[setting.name] = setting
        return found

    def stream(self, setting: Setting, purpose: str) -> np.random.Generator:
        """Return the random generator of one purpose in one setting."""
        return seeds.generator(self.seed, 0, f"{setting.name} {purpose}")

    def spoilt(self, name: str) -> Spoilt:
        """Return the problems of a setting by its name; ValueError for unknown ones."""
        if name not in self.settings:
            raise ValueError(f"problems: got {name!r}, allowed: one of the {len(self.settings)} of the benchmark")
        setting = self.settings[name]
        placed = _placed(setting, self.stream(setting, "poses"))
        points = problems.images(
            placed, focal_px=self.protocol.focal_px, noise_px=self.protocol.noise_px,
            rng=self.stream(setting, "noise"),
        )  # fmt: skip
        points, inliers = _with_outliers(points, setting, self.stream(setting, "outliers"))
        return Spoilt(Batch(placed, points), inliers)


def _placed(setting: Setting, rng: np.random.Generator) -> Placed:
    part, count = setting.part, setting.trials
    if not part.flat:
        return problems.random_points(points=part.points, count=count, rng=rng)
    targets_m = np.zeros((count, part.points, 3))
    targets_m[..., :2] = rng.uniform(-_FLAT_M, _FLAT_M, (count, part.points, 2))
    each = [problems.in_box(target_m, count=1, rng=rng) for target_m in targets_m]
    return Placed(*(np.concatenate(values) for values in zip(*each, strict=True)))


def _with_outliers(points: np.ndarray, setting: Setting, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return images (B, n, 2) of which some are wrong, and which are right (B, n)."""
    points, inliers = points.copy(), np.ones(points.shape[:2], bool)
    for image, good in zip(points, inliers, strict=True):
        wrong = rng.permutation(setting.part.points)[: setting.outliers]
        good[wrong] = False
        if setting.part.wrong == "swapped":
            # each takes the next one's: none keeps its own
            image[wrong] = image[np.roll(wrong, 1)]
        else:
            image[wrong] = rng.uniform(-FIELD, FIELD, (len(wrong), 2))
    return points, inliers
