"""Where the tags lie that a video shows: a TOML file as a strict, frozen model."""

from fnmatch import fnmatch
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from uwsim.files import read_toml, shipped
from uwsim.pose.detect import dictionary
from uwsim.validation import validated

Text = Annotated[str, Field(min_length=1)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class Tag(BaseModel):
    """A tag and the place of its centre on the plane."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    id: Annotated[int, Field(ge=0)]
    position_m: Annotated[tuple[Finite, Finite], Field(strict=False, description="x and y on the plane")]


class Layout(BaseModel):
    """Equal tags on a plane, all turned alike, and the videos that show them.

    The plane is seen from the side on which x turns into y anticlockwise.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    description: Annotated[Text, Field(description="one sentence for tables")]
    source: Annotated[Text, Field(description="who measured it")]
    videos: Annotated[
        tuple[Text, ...], Field(strict=False, min_length=1, description="patterns of file names, such as tank_*.mp4")
    ]
    every_nth_frame: Annotated[int, Field(ge=1, description="frames that are scored; 1: all")] = 10
    family: Annotated[Text, Field(description="the tags' dictionary as OpenCV names it: DICT_APRILTAG_36h11")]
    side_m: Annotated[Positive, Field(description="length of a tag's black side")]
    right_deg: Annotated[
        Finite, Field(description="direction on the plane from a tag's first corner to its second, from x towards y")
    ] = 0.0
    intrinsics_px: Annotated[
        tuple[Positive, Positive, Finite, Finite] | None,
        Field(strict=False, description="fx, fy, cx, cy of the camera in water; pixel centres at integers"),
    ] = None
    tags: Annotated[tuple[Tag, ...], Field(strict=False, min_length=2)]

    @model_validator(mode="after")
    def _tags_agree(self):
        count = len(dictionary(self.family, what="family").bytesList)
        identities = [tag.id for tag in self.tags]
        if max(identities) >= count:
            raise ValueError(f"tags: got id {max(identities)}, allowed: below {count} in {self.family}")
        if repeated := sorted({one for one in identities if identities.count(one) > 1}):
            raise ValueError(f"tags: got id {repeated[0]} twice, allowed: each once")
        places = np.array([tag.position_m for tag in self.tags])
        apart = np.linalg.norm(places[:, None] - places, axis=-1) + self.side_m * np.eye(len(places))
        if apart.min() < self.side_m:
            raise ValueError(
                f"tags: got centres {apart.min():g} m apart, allowed: at least the side of {self.side_m} m"
            )
        return self

    def describes(self, video: Path) -> bool:
        """Return whether a pattern fits the name of a video file."""
        return any(fnmatch(video.name, pattern) for pattern in self.videos)

    def corners_m(self) -> dict[int, np.ndarray]:
        """Return {id: corners (4, 2) on the plane [m]} in the order in which OpenCV finds them."""
        turn = np.deg2rad(self.right_deg)
        right, up = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
        offsets = self.side_m / 2 * np.array([-right + up, right + up, right - up, -right - up])
        return {tag.id: np.array(tag.position_m) + offsets for tag in self.tags}

    def K(self) -> np.ndarray | None:
        """Return the camera matrix (3, 3) [px], None where the layout states none."""
        if self.intrinsics_px is None:
            return None
        fx, fy, cx, cy = self.intrinsics_px
        return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])


def read_layout(path: Path) -> Layout:
    """Return the layout in a TOML file; ValueError in one line: file, key, value, what is allowed."""
    return validated(Layout, read_toml(path), where=f"{path}: not a layout of tags")


def shipped_layouts() -> list[Path]:
    """Return the layouts that come with uwsim."""
    return sorted(path for path in (shipped("benchmarks") / "photos").glob("*.toml") if path.stem != "calibration")


def layout_of(video: Path, own: dict[str, Layout], others: dict[str, Layout]) -> str | None:
    """Return the name of the layout that describes a video, the user's own before others; None if none does.

    ValueError if two of the same kind describe it.
    """
    for layouts in (own, others):
        found = [name for name, layout in layouts.items() if layout.describes(video)]
        if len(found) > 1:
            raise ValueError(f"{video}: described by layouts {' and '.join(found)}, allowed: by one")
        if found:
            return found[0]
    return None
