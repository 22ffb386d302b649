"""The scores that see a picture alone, held against what other people's code makes of the same photographs."""

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from uwsim.files import read_toml, sha256, shipped
from uwsim.images import read_srgb
from uwsim.metrics.uciqe import uciqe_o
from uwsim.metrics.uiqm import uiqm_f, uiqm_m
from uwsim.validation import validated


class Known(BaseModel):
    """A photograph by its checksum, and its scores by other code; `uiqm_f_native` is of the picture not resized."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    name: str
    origin: str
    sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
    uiqm_f: float
    uiqm_f_native: float
    uiqm_m: float
    uciqe_o: float


class Calibration(BaseModel):
    """Photographs whose scores are known, and how near to them this code must come."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    tolerance: Annotated[float, Field(gt=0)]
    uiqm_f_blue_weight: float
    photographs: Annotated[tuple[Known, ...], Field(strict=False)]


def read_calibration() -> Calibration:
    """Return the calibration that comes with uwsim."""
    path = shipped("benchmarks") / "photos/calibration.toml"
    return validated(Calibration, read_toml(path), where=path)


def compared(files: Iterable[Path], calibration: Calibration) -> list[dict]:
    """Return {"name", "metric", "known", "measured"} of each metric of each file whose checksum is known."""
    known = {one.sha256: one for one in calibration.photographs}
    rows = []
    for path in files:
        if (one := known.get(sha256(path))) is None:
            continue
        measured = as_published(read_srgb(path), calibration)
        rows += [
            {"name": one.name, "metric": key, "known": getattr(one, key), "measured": value}
            for key, value in measured.items()
        ]
    return rows


def as_published(picture: np.ndarray, calibration: Calibration) -> dict[str, float]:
    """Return the scores of a picture (H, W, 3) uint8 in the variants of the published code."""
    weight = calibration.uiqm_f_blue_weight
    return {
        "uiqm_f": uiqm_f(picture, blue_weight=weight),
        "uiqm_f_native": uiqm_f(picture, resize=False, blue_weight=weight),
        "uiqm_m": uiqm_m(picture),
        "uciqe_o": uciqe_o(picture),
    }
