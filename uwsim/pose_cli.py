"""The commands `uwsim pose ...`."""

import sys
from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(help="Pose of markers: how well a layout and a camera can do.", no_args_is_help=True)


@app.callback()
def _group() -> None:
    """Keep the commands' names, of which there might be one alone."""


@app.command()
def layout(
    layout: Annotated[
        str, typer.Argument(help="octahedron, pyramid, stereo, square, or a .toml or .csv of points [m]")
    ],
    camera: Annotated[str, typer.Option(help="WIDTHxHEIGHT, or a TOML file with width_px, height_px, K_px.")],
    out: Annotated[Path, typer.Option("--out", help="Folder for layout.png, layout.json, layout.csv.")],
    fov_deg: Annotated[float | None, typer.Option(help="Horizontal field of view in the water [deg].")] = None,
    focal_px: Annotated[float | None, typer.Option(help="Focal length in the water [px], instead.")] = None,
    noise_px: Annotated[float, typer.Option(help="Standard deviation of each image coordinate [px].")] = 0.2,
    edge_m: Annotated[float | None, typer.Option(help="Edge of a layout by name [m]; 0.1.")] = None,
    distance_m: Annotated[float, typer.Option(help="Working distance, where it is not swept [m].")] = 1.0,
    tilt_deg: Annotated[float, typer.Option(help="Angle of the target's z to the axis, where it is not swept.")] = 30.0,
    trials: Annotated[int, typer.Option(min=0, help="Noisy images solved at each of nine places; 0: none.")] = 100,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the noise.")] = 0,
) -> None:
    """Draw the pose errors to expect from a marker layout: over distance, off the axis, over the angle."""
    from uwsim.commands import require_folder
    from uwsim.pose.design_files import read_view, write_design
    from uwsim.pose.layouts import read_layout

    require_folder(out)
    points_m = read_layout(layout, edge_m=edge_m)
    view = read_view(camera, fov_deg=fov_deg, focal_px=focal_px, noise_px=noise_px)
    least = write_design(
        Path(layout).stem, points_m, view, out, distance_m=distance_m, tilt_deg=tilt_deg, trials=trials, seed=seed
    )
    at = f"at {distance_m:g} m, {tilt_deg:g} deg: "
    errors = "not whole in the picture"
    if least["rotation_bound_deg"] == least["rotation_bound_deg"]:
        errors = f"{least['rotation_bound_deg']:.3g} deg, {least['translation_bound_percent']:.3g} % at the least"
    sys.stdout.write(f"{out / 'layout.png'}: {at}{errors}\n")
