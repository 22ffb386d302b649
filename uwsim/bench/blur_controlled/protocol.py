"""What frames a benchmark makes itself: the table `frames` of its TOML file as strict, frozen models."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

Name = Annotated[str, Field(min_length=1)]
BLURRED_BY = ("otf", "sub_frames", "sub_frames_with_ends")


class _Strict(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class Texture(_Strict):
    """A picture of scikit-image, of less contrast if asked for; or a Gaussian field, drawn anew in each frame."""

    picture: Annotated[Name | None, Field(description="function of skimage.data")] = None
    contrast: Annotated[float, Field(gt=0, le=1, description="factor on the picture, about its mean")] = 1.0
    exponent: Annotated[float | None, Field(ge=0, le=5, description="of the field's power spectrum, 1 / r^n")] = None
    std: Annotated[float | None, Field(gt=0, le=0.2, description="of the field, 1 = white")] = None
    use: Annotated[Literal["tuning", "test"], Field(description="tuning: methods may have been set on it")]
    periodic: Annotated[bool, Field(description="repeats itself: reported apart")] = False

    @model_validator(mode="after")
    def _one_of_both(self):
        field = self.exponent is not None, self.std is not None
        if any(field) != all(field) or any(field) == (self.picture is not None):
            raise ValueError("allowed: either picture, or exponent and std")
        return self


class Part(_Strict):
    """All combinations of textures, lengths, angles and noise; at length 0 frames are sharp, whatever the angle."""

    blurred_by: Annotated[
        Literal[BLURRED_BY],
        Field(description="exact transfer function, or sub-frames at mid-points (or with both ends: wrong)"),
    ]
    lengths_px: Annotated[tuple[Annotated[float, Field(ge=0, le=40)], ...], Field(min_length=1)]
    angles_deg: Annotated[tuple[Annotated[float, Field(ge=0, lt=180)], ...], Field(min_length=1)]
    noise_percent: Annotated[tuple[Annotated[float, Field(ge=0, le=20)], ...], Field(min_length=1)]
    textures: Annotated[tuple[Name, ...] | None, Field(description="left out: all")] = None
    places: Annotated[int, Field(ge=1, le=5, description="crops of each picture, with length 0 only")] = 1

    @model_validator(mode="after")
    def _places_are_sharp(self):
        if self.places > 1 and set(self.lengths_px) != {0.0}:
            raise ValueError(f"places: got {self.places} with lengths {self.lengths_px}, allowed: with lengths [0.0]")
        return self


class Protocol(_Strict):
    """Frames of `side_px` squared: of `parts`, in quick runs of `quick_parts`."""

    seed: Annotated[int, Field(ge=0)]
    side_px: Annotated[int, Field(ge=32, le=256, description="the blurred crop is larger: nothing comes in at borders")]
    textures: dict[Name, Texture]
    parts: Annotated[tuple[Part, ...], Field(min_length=1)]
    quick_parts: Annotated[tuple[Part, ...], Field(min_length=1)]

    @model_validator(mode="after")
    def _textures_are_known(self):
        for part in (*self.parts, *self.quick_parts):
            if unknown := set(part.textures or ()) - set(self.textures):
                raise ValueError(f"textures: got {min(unknown)!r}, allowed: {', '.join(self.textures)}")
        return self
