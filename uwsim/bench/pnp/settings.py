"""Settings of pose problems, made when asked for: each from named random streams, so also each alone."""

import hashlib
import json
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uwsim import seeds
from uwsim.bench.pnp import layouts
from uwsim.bench.pnp.protocol import Part, Protocol
from uwsim.pose import problems
from uwsim.pose.problems import Placed

NEAREST_M = 0.01
"""No point of a target is nearer to the camera."""
NEAR_RATIOS = (0.9, 1.5)
"""Depths over the target's edge that count as near."""
_UNITS = {"noise_px": "px", "depth_m": "m", "off_axis_m": "m", "angle_deg": "deg", "points": "points"}
_TIMED_BOX_M = np.array([[-0.1, -0.1, 0.58], [0.1, 0.1, 0.78]])
_LATERAL_SHARE = 0.4


@dataclass(frozen=True)
class Setting:
    """One value of a part's sweep; all its problems are scored together."""

    part_name: str
    part: Part
    value: float
    trials: int

    @property
    def name(self) -> str:
        return f"{self.part_name}/{self.value:g} {_UNITS[self.part.sweep]}"

    def of(self, quantity: str) -> float | None:
        """Return a quantity of the part, or the sweep's value."""
        return self.value if quantity == self.part.sweep else getattr(self.part, quantity)

    @property
    def points(self) -> int:
        return self.part.points(self.value)

    @property
    def flat(self) -> bool:
        return layouts.is_flat(self.part.layout)

    @property
    def noise(self) -> float:
        """Standard deviation of the image coordinates on the plane z = 1."""
        return self.of("noise_px") / self.part.focal_px

    @property
    def depth_ratio(self) -> float | None:
        """Depth over the target's edge; None where depths differ or points fill the box."""
        size_m, depth_m = layouts.size_m(self.part.layout, self.part.edge_m), self.of("depth_m")
        return depth_m / size_m if depth_m is not None and size_m is not None else None

    @property
    def near(self) -> bool:
        low, high = NEAR_RATIOS
        return self.depth_ratio is not None and low - 1e-9 <= self.depth_ratio < high - 1e-9


@dataclass(frozen=True)
class Batch:
    """The problems of a setting: targets and true poses, image points (B, n, 2) with noise on the plane z = 1."""

    placed: Placed
    points: np.ndarray


@dataclass(frozen=True)
class Problems:
    """The problems of a protocol; they stand for a dataset: `name`, `seed`, `sha256`."""

    protocol: Protocol
    quick: bool

    name = "made while it runs"

    @property
    def seed(self) -> int:
        return self.protocol.seed

    @cached_property
    def sha256(self) -> str:
        """Hash of the protocol and of the layouts."""
        found = hashlib.sha256(json.dumps(self.protocol.model_dump(mode="json"), sort_keys=True).encode())
        for name, points in sorted(layouts.LAYOUTS.items()):
            found.update(name.encode() + points.tobytes())
        return found.hexdigest()

    @cached_property
    def settings(self) -> dict[str, Setting]:
        """Name -> setting, in the order of the protocol."""
        protocol, found = self.protocol, {}
        for name, part in protocol.parts.items():
            values = (part.quick_values or ()) if self.quick else part.values
            trials = (part.quick_trials or protocol.quick_trials) if self.quick else (part.trials or protocol.trials)
            for value in values:
                setting = Setting(name, part, value, trials)
                found[setting.name] = setting
        return found

    def stream(self, setting: Setting, purpose: str) -> np.random.Generator:
        """Return the random generator of one purpose in one setting."""
        return seeds.generator(self.seed, 0, f"{setting.name} {purpose}")

    def batch(self, name: str) -> Batch:
        """Return the problems of a setting by its name; ValueError for unknown ones."""
        if name not in self.settings:
            raise ValueError(f"problems: got {name!r}, allowed: one of the {len(self.settings)} of the benchmark")
        setting = self.settings[name]
        placed = _placed(setting, self.stream(setting, "poses"))
        points = problems.images(
            placed, focal_px=setting.part.focal_px, noise_px=setting.of("noise_px"), rng=self.stream(setting, "noise")
        )
        return Batch(placed, points)


def _placed(setting: Setting, rng: np.random.Generator) -> Placed:
    part, count = setting.part, setting.trials
    if part.layout == "cloud7":
        return _clouds(setting, rng)
    if layouts.is_random(part.layout):
        return problems.random_points(points=setting.points, count=count, rng=rng, box_m=_box_m(setting))
    target_m = part.edge_m * layouts.LAYOUTS[part.layout]
    if part.placed == "angle":
        return _turned(target_m, angle_deg=setting.of("angle_deg"), depth_m=setting.of("depth_m"), count=count)
    if part.placed == "off_axis":
        place_m = (0.0, setting.of("off_axis_m"), setting.of("depth_m"))
        return problems.at_place(target_m, place_m=place_m, count=count, rng=rng, nearest_m=NEAREST_M)
    if part.placed == "depth":
        return problems.at_depth(
            target_m, depth_m=setting.of("depth_m"), count=count, rng=rng, lateral_share=_LATERAL_SHARE,
            nearest_m=NEAREST_M,
        )  # fmt: skip
    return problems.in_box(target_m, count=count, rng=rng)


def _box_m(setting: Setting) -> np.ndarray:
    """Return the box of random points: the timed ones', the one at a depth, or the usual."""
    if setting.part.layout == "random":
        return _TIMED_BOX_M
    box_m, depth_m = problems.BOX_M.copy(), setting.of("depth_m")
    if depth_m is not None:
        box_m[:, 2] = max(depth_m, NEAREST_M), depth_m + 1.0
    return box_m


def _turned(target_m: np.ndarray, *, angle_deg: float, depth_m: float, count: int) -> Placed:
    """Return a target on the axis, turned about the camera's y alone, `count` times."""
    from scipy.spatial.transform import Rotation

    rotation = Rotation.from_euler("y", angle_deg, degrees=True).as_matrix()
    return Placed(
        np.tile(target_m, (count, 1, 1)), np.tile(rotation, (count, 1, 1)), np.tile([0.0, 0.0, depth_m], (count, 1))
    )


def _clouds(setting: Setting, rng: np.random.Generator) -> Placed:
    """Return targets of normally drawn points, another one in each trial, as `problems.at_depth` places them.

    Those with a point too near are drawn again.
    """
    count, side_m = setting.trials, _LATERAL_SHARE * setting.of("depth_m")
    centre_m = np.array([0.0, 0.0, setting.of("depth_m")])
    points_m, rotation = np.empty((count, setting.points, 3)), np.empty((count, 3, 3))
    translation_m = centre_m + side_m * np.column_stack([rng.uniform(-1, 1, (count, 2)), np.zeros(count)])
    left = np.arange(count)
    for _ in range(100):
        points_m[left] = layouts.CLOUD_M * rng.standard_normal((len(left), setting.points, 3))
        rotation[left] = problems.random_rotations(len(left), rng=rng)
        depth_m = (points_m[left] @ rotation[left, 2, :, None])[..., 0] + translation_m[left, 2, None]
        left = left[depth_m.min(axis=1) < NEAREST_M]
        if not len(left):
            return Placed(points_m, rotation, translation_m)
    raise ValueError(
        f"{setting.name}: {len(left)} targets keep a point nearer than {NEAREST_M} m, allowed: farther off"
    )
