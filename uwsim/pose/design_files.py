"""The design of a marker layout on disk: the camera it is for, and the picture, JSON and CSV of its expected errors."""

import csv
import io
import re
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from uwsim.camera.pinhole import camera_matrix
from uwsim.files import read_toml, write_atomically, write_json, write_text
from uwsim.pose import design, design_trials, limits
from uwsim.pose.design_plots import plot_design
from uwsim.validation import validated, with_tuples

Focal = Annotated[float, Field(ge=limits.FOCAL_PX.least, le=limits.FOCAL_PX.most, allow_inf_nan=False)]
FieldOfView = Annotated[float, Field(ge=limits.FOV_DEG.least, le=limits.FOV_DEG.most, allow_inf_nan=False)]
FILES = ("layout.png", "layout.json", "layout.csv")
Finite = Annotated[float, Field(allow_inf_nan=False)]
Pixels = Annotated[int, Field(ge=1, le=16384)]


class Pinhole(BaseModel):
    """A pinhole in the water: field of view, or K as (fx, fy, cx, cy) [px]."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    width_px: Pixels
    height_px: Pixels
    horizontal_fov_deg: FieldOfView | None = None
    K_px: tuple[Focal, Focal, Finite, Finite] | None = None

    @model_validator(mode="after")
    def _one_way(self):
        if (self.horizontal_fov_deg is None) == (self.K_px is None):
            raise ValueError("give either horizontal_fov_deg or K_px = [fx, fy, cx, cy]")
        if self.K_px is not None and not (0 < self.K_px[2] < self.width_px and 0 < self.K_px[3] < self.height_px):
            raise ValueError(f"K_px: got cx, cy = {self.K_px[2]:g}, {self.K_px[3]:g}, allowed: within the picture")
        return self

    @property
    def K(self) -> np.ndarray:
        """Camera matrix (3, 3) [px]."""
        if self.K_px is None:
            return camera_matrix(
                width_px=self.width_px, height_px=self.height_px, horizontal_fov_deg=self.horizontal_fov_deg
            )
        fx, fy, cx, cy = self.K_px
        return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])


def read_view(camera: str, *, fov_deg: float | None, focal_px: float | None, noise_px: float) -> design.View:
    """Return the camera of a TOML file, or of WIDTHxHEIGHT with one of `fov_deg` (horizontal) and `focal_px`.

    The file has width_px, height_px and horizontal_fov_deg or K_px. ValueError for anything else.
    """
    limits.NOISE_PX.check(noise_px, name="noise_px")
    given = {"--fov-deg": fov_deg, "--focal-px": focal_px}
    given = {name: value for name, value in given.items() if value is not None}
    if Path(camera).suffix.lower() == ".toml":
        if given:
            raise ValueError(f"{', '.join(given)}: got with the file {camera}, allowed: with a size")
        pinhole = validated(Pinhole, with_tuples(read_toml(Path(camera))), where=camera)
    else:
        pinhole = _of_size(camera, given)
    return design.View(pinhole.K, pinhole.width_px, pinhole.height_px, float(noise_px))


def _of_size(camera: str, given: dict[str, float]) -> Pinhole:
    match = re.fullmatch(r"(\d{1,5})x(\d{1,5})", camera)
    if not match:
        raise ValueError(f"--camera: got {camera!r}, allowed: WIDTHxHEIGHT such as 1280x720, or a .toml file")
    if len(given) != 1:
        got = ", ".join(given) or "neither"
        raise ValueError(f"--camera {camera}: got {got}, allowed: one of --fov-deg and --focal-px")
    ((name, value),) = given.items()
    width_px, height_px = int(match[1]), int(match[2])
    values = {"width_px": width_px, "height_px": height_px}
    if name == "--fov-deg":
        values["horizontal_fov_deg"] = value
    else:
        values["K_px"] = (value, value, width_px / 2, height_px / 2)
    return validated(Pinhole, values, where=f"--camera {camera} {name} {value:g}")


def write_design(
    name: str, points_m: np.ndarray, view: design.View, out: Path, *, distance_m: float, tilt_deg: float, trials: int,
    seed: int,
) -> dict[str, float]:  # fmt: skip
    """Write layout.png, layout.json and layout.csv into the folder `out`; return the bound at the working distance.

    `trials`: noisy images solved at each of some places; 0: none. Nothing is written before all is made. ValueError
    where the target is nowhere whole in the picture or its pose everywhere open, and for a file that is a folder.
    """
    limits.TRIALS.check(trials, name="trials")
    limits.SEED.check(seed, name="seed")
    for file in FILES:
        if (out / file).is_dir():
            raise ValueError(f"{out / file}: is a folder, allowed: a file, or none yet")
    found = []
    for index, sweep in enumerate(design.sweeps(view, distance_m=distance_m, tilt_deg=tilt_deg)):
        rng = np.random.default_rng([seed, index])
        curves = design.curves(points_m, sweep, view)
        found.append(
            (sweep, curves, design_trials.tried(points_m, sweep, view, trials=trials, rng=rng) if trials else None)
        )
    _check_seen(name, [curves.rotation_bound_deg for _, curves, _ in found], distance_m=distance_m)
    given = {"layout": name, "points_m": points_m.tolist(), "K_px": view.K.tolist(), "width_px": view.width_px}
    given |= {"height_px": view.height_px, "noise_px": view.noise_px, "distance_m": distance_m, "tilt_deg": tilt_deg}
    given |= {"trials": trials, "seed": seed, "left_out": design.left_out(points_m)}
    title = f"{name}, {len(points_m)} points; f = {view.K[0, 0]:.0f} px, noise {view.noise_px:g} px; where fixed: "
    title += f"{distance_m:g} m, on the axis, tilted by {tilt_deg:g} deg"
    picture = io.BytesIO()
    plot_design(title, found, picture, left_out=given["left_out"])
    out.mkdir(exist_ok=True)
    write_json(out / "layout.json", given | {"sweeps": {one[0].quantity: _numbers(*one) for one in found}})
    write_text(out / "layout.csv", _csv(found))
    write_atomically(out / "layout.png", lambda path: path.write_bytes(picture.getvalue()))
    # the sweep off the axis begins at the working place itself
    here = found[1][1]
    return {key: float(getattr(here, key)[0]) for key in ("rotation_bound_deg", "translation_bound_percent")}


def _check_seen(name: str, bounds_deg: list[np.ndarray], *, distance_m: float) -> None:
    """ValueError where no bound (p,) of all the sweeps is a number."""
    if np.isfinite(np.concatenate(bounds_deg)).any():
        return
    ends = f"from {distance_m / 4:g} to {4 * distance_m:g} m"
    if np.isnan(np.concatenate(bounds_deg)).all():
        raise ValueError(
            f"layout {name}: nowhere whole in the picture {ends}, allowed: a longer --distance-m, a smaller layout or "
            "a wider view"
        )
    raise ValueError(
        f"layout {name}: too small in the picture for a pose to follow {ends}, allowed: a shorter --distance-m or a "
        "larger layout"
    )


def _numbers(sweep: design.Sweep, curves: design.Curves, trials: design_trials.Trials | None) -> dict:
    numbers = {sweep.quantity: _plain(sweep.values)}
    numbers |= {name: _plain(values) for name, values in curves._asdict().items()}
    if trials is not None:
        numbers["trials"] = {name: _plain(values) for name, values in trials._asdict().items()}
    return numbers


def _plain(values: np.ndarray) -> list[float | None]:
    return [float(value) if np.isfinite(value) else None for value in values]


def _csv(found: list) -> str:
    """Return a tidy table: one number a row."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("sweep", "value", "curve", "error"))
    for sweep, curves, trials in found:
        tables = [(sweep.values, curves._asdict())]
        if trials is not None:
            measured = {f"best_{name}": values for name, values in trials._asdict().items() if name != "values"}
            tables.append((trials.values, measured))
        for places, table in tables:
            for name, values in table.items():
                rows = zip(places, values, strict=True)
                writer.writerows((sweep.quantity, f"{at:.6g}", name, f"{v:.6g}") for at, v in rows if np.isfinite(v))
    return text.getvalue()
