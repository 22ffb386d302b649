"""The commands `uwsim pose ...`."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from uwsim.pose import limits

app = typer.Typer(help="Pose of markers: how well a layout and a camera can do.", no_args_is_help=True)


@app.callback()
def _group() -> None:
    """Keep the commands' names, of which there might be one alone."""


def _within(allowed: limits.Limits, kind: type = float) -> dict:
    """Return settings of an option whose number has to be within limits; what is wrong with it is said by its name."""
    return {"parser": _parser(allowed, kind), "metavar": "<int>" if kind is int else "<float>"}


def _parser(allowed: limits.Limits, kind: type) -> Callable[[object], float]:
    def parse(value: object) -> float:
        try:
            number = kind(value)
        except ValueError:
            number = None
        # Python's own spelling of numbers has underscores, nobody else's
        if number is None or "_" in str(value) or not allowed.least <= number <= allowed.most:
            what = "a whole number, " if kind is int else ""
            raise typer.BadParameter(f"got {_short(value)}, allowed: {what}{allowed}")
        return number

    return parse


def _short(value: object) -> str:
    text = str(value)
    return repr(text if len(text) <= 40 else f"{text[:37]}...")


@app.command()
def layout(
    layout: Annotated[
        str, typer.Argument(help="octahedron, pyramid, stereo, square, or a .toml or .csv of points (m)")
    ],
    camera: Annotated[str, typer.Option(help="WIDTHxHEIGHT, or a TOML file with width_px, height_px, K_px.")],
    out: Annotated[str, typer.Option("--out", help="Folder for layout.png, layout.json, layout.csv.")],
    fov_deg: Annotated[
        float | None, typer.Option(help="Horizontal field of view in the water (deg).", **_within(limits.FOV_DEG))
    ] = None,
    focal_px: Annotated[
        float | None, typer.Option(help="Focal length in the water (px), instead.", **_within(limits.FOCAL_PX))
    ] = None,
    noise_px: Annotated[
        float, typer.Option(help="Standard deviation of each image coordinate (px).", **_within(limits.NOISE_PX))
    ] = 0.2,
    edge_m: Annotated[
        float | None, typer.Option(help="Edge of a layout by name (m); 0.1.", **_within(limits.SIZE_M))
    ] = None,
    distance_m: Annotated[
        float, typer.Option(help="Working distance, where it is not swept (m).", **_within(limits.DISTANCE_M))
    ] = 1.0,
    tilt_deg: Annotated[
        float,
        typer.Option(help="Angle of the target's z to the axis, where it is not swept.", **_within(limits.TILT_DEG)),
    ] = 30.0,
    trials: Annotated[
        int, typer.Option(help="Noisy images solved at each of nine places; 0: none.", **_within(limits.TRIALS, int))
    ] = 100,
    seed: Annotated[int, typer.Option(help="Seed of the noise.", **_within(limits.SEED, int))] = 0,
) -> None:
    """Draw the pose errors to expect from a marker layout: over distance, off the axis, over the angle."""
    from uwsim.commands import require_folder
    from uwsim.pose import design
    from uwsim.pose.design_files import read_view, write_design
    from uwsim.pose.layouts import read_layout

    if not out.strip():
        raise ValueError(f"--out: got {out!r}, allowed: the name of a folder")
    folder = Path(out)
    require_folder(folder)
    points_m = read_layout(layout, edge_m=edge_m)
    view = read_view(camera, fov_deg=fov_deg, focal_px=focal_px, noise_px=noise_px)
    least = write_design(
        Path(layout).stem, points_m, view, folder, distance_m=distance_m, tilt_deg=tilt_deg, trials=trials, seed=seed
    )
    at = f"at {distance_m:g} m, {tilt_deg:g} deg: "
    errors = "not whole in the picture"
    if least["rotation_bound_deg"] == least["rotation_bound_deg"]:
        errors = f"{least['rotation_bound_deg']:.3g} deg, {least['translation_bound_percent']:.3g} % at the least"
    sys.stdout.write(f"{folder / 'layout.png'}: {at}{errors}\n")
    for why in sorted(set(design.left_out(points_m).values())):
        sys.stdout.write(f"formulas of a plane (5.11-5.13) left out: {why}\n")
