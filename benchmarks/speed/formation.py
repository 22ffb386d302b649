"""Seconds of the formation models at 640x480, beside the same formulas written out in NumPy, in one run.

    python benchmarks/speed/formation.py [--quick] [--only MODEL ...] [--json -]

Scene: `tank_usaf` as shipped; its geometry is found first and not timed, views begin without tables. The formulas
written out (`formation_literal.py`, and tests/references/jaffe_mcglamery_literal.py for Jaffe-McGlamery and multistage)
loop over wavelengths and slabs; they are timed on one wavelength and on six (Jaffe-McGlamery: and on one slab and on
three), and the time of all follows, as it is linear in both. Ratios are of CPU seconds of the process, which a busy
machine does not change; `seconds` are those on the wall. On a small picture, with all wavelengths, both are compared:
the largest difference relative to the mean of the picture. Medians of rounds that alternate.
"""

import argparse
import dataclasses
import importlib.util
import statistics
import sys
import time
import types
from pathlib import Path

import document
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
FULL, SMALL, QUICK = (640, 480), (40, 30), (160, 120)
GRID, FINE_GRID = 61, 121  # wavelengths of the formulas written out; of the Jaffe-McGlamery reference
JM_SLABS = 24


def view_of(width_px: int, height_px: int):
    """Return the view of tank_usaf at a size."""
    from uwsim.camera.lens import pixel_centres
    from uwsim.dataset import make
    from uwsim.formation import records
    from uwsim.formation.view import View, albedo_of_bands, pixel_angle_rad
    from uwsim.render import film, geometry
    from uwsim.scene.load import scene_values
    from uwsim.scene.models import Scene

    values, _ = scene_values("tank_usaf")
    size = {"width_px": width_px, "height_px": height_px}
    values["rig"]["camera"] |= size
    scene = Scene.model_validate(values)
    seen = film.view_of(scene)
    buffers = geometry.geometry(scene, seen)
    origins, directions = geometry.pixel_rays(scene, seen)
    albedo, spectra = albedo_of_bands(buffers["albedo"], response=seen.response)
    entries = [
        make._lamp(lamp, scene.rig.world_from_rig, n_water=scene.water.refractive_index) for lamp in scene.rig.lamps
    ]
    return View(
        origins_m=origins, directions=directions, range_m=buffers["range"], normals=buffers["normal"], albedo=albedo,
        albedo_spectra=spectra, water=scene.water.optical(),
        lamps=tuple(led for entry in entries for led in records.leds(entry)), response=seen.response,
        factor=scene.lens.radiance_factor(pixel_centres(**size)), pixel_angle_rad=pixel_angle_rad(scene.lens, **size),
    )  # fmt: skip


def literal_jaffe_mcglamery():
    path = ROOT / "tests" / "references" / "jaffe_mcglamery_literal.py"
    spec = importlib.util.spec_from_file_location("jaffe_mcglamery_literal", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def pairs() -> dict:
    """Return {name: (model of a view, written out of (view, wavelengths, slabs), numbers of both in all)}.

    Written out is None where there is nothing of its own to time; slabs is None where they are not a number to choose.
    """
    import formation_literal as literal

    from uwsim.formation import airlight
    from uwsim.formation.models import beer_lambert, jaffe_mcglamery, multistage, revised, simplified
    from uwsim.formation.spread import spread

    reference = literal_jaffe_mcglamery()

    def written_out_jm(view, count, slabs):
        rule = spread(view, spectral=True)
        few = types.SimpleNamespace(
            **{field.name: getattr(view, field.name) for field in dataclasses.fields(view)},
            shape=view.shape, points_m=view.points_m, weights=view.weights[:count],
        )  # fmt: skip

        def width(side):
            return lambda path: path * rule.damping_rad_per_m(np.asarray(path), side=side)

        found = reference.layers(
            few, source_loss=rule.media[0].loss[::2], camera_loss=rule.media[1].loss[::2],
            source_width=width("source"), camera_width=width("camera"), slabs=slabs,
        )  # fmt: skip
        found = {name: layer * view.factor[..., None] for name, layer in found.items()}
        return found | {"radiance": sum(found.values())}

    def forward(view, count, _):
        return literal.simplified_forward(view, rule=spread(view, spectral=True), count=count)

    grid = (GRID, None)
    return {
        "airlight": (
            lambda view: {"radiance": sum(airlight.single(view, lamp) for lamp in view.lamps)},
            lambda view, count, _: {"radiance": literal.single_scattering(view, count=count)},
            grid,
        ),
        "beer_lambert": (beer_lambert.layers, lambda view, count, _: literal.beer_lambert(view, count=count), grid),
        "revised": (revised.layers, lambda view, count, _: literal.revised(view, count=count), grid),
        "simplified": (simplified.layers, lambda view, count, _: literal.simplified(view, count=count), grid),
        "simplified_forward": (lambda view: simplified.layers(view, forward_scatter=True), forward, grid),
        "multistage": (multistage.layers, None, grid),
        "jaffe_mcglamery": (jaffe_mcglamery.layers, written_out_jm, (FINE_GRID, JM_SLABS)),
    }


def seconds_of(function, *arguments) -> tuple[float, float]:
    """Return seconds on the wall and CPU seconds of a call."""
    wall, cpu = time.perf_counter(), time.process_time()
    function(*arguments)
    return time.perf_counter() - wall, time.process_time() - cpu


def written_out_seconds(function, view, wavelengths: int, slabs: int | None) -> float:
    """Return the CPU seconds of all wavelengths and slabs, from those of a few."""

    def of(count: int | None) -> float:
        few, more = (
            min(seconds_of(function, dataclasses.replace(view), n, count)[1] for _ in range(2)) for n in (1, 6)
        )  # fmt: skip
        return few + (wavelengths - 1) * max(more - few, 0.0) / 5

    if slabs is None:
        return of(None)
    few, more = of(1), of(3)
    return few + (slabs - 1) * max(more - few, 0.0) / 2


def compare(model, written_out, view, slabs) -> float:
    """Return the largest difference of the radiance relative to its mean."""
    found, literal = model(view)["radiance"], written_out(view, None, slabs)["radiance"]
    return float(np.abs(found - literal).max() / literal.mean())


def main() -> int:
    """Measure, print a table, write tidy records."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a small picture: shows that it runs")
    parser.add_argument("--json", help="where to write the records; - for standard output")
    parser.add_argument("--only", nargs="+", metavar="MODEL", help="these models; all: airlight, beer_lambert ...")
    arguments = parser.parse_args()
    from uwsim.render import variants

    variants.use()
    size = QUICK if arguments.quick else FULL
    view, small = view_of(*size), view_of(*SMALL)
    records = []

    def record(metric: str, algorithm: str, value: float, **sweep) -> None:
        records.append(
            {"benchmark": "speed/formation", "metric": metric, "algorithm": algorithm, **sweep, "value": value}
        )

    known = pairs()
    if unknown := set(arguments.only or known) - set(known):
        parser.error(f"--only: got {', '.join(sorted(unknown))}, allowed: {', '.join(known)}")
    for name in arguments.only or known:
        model, written_out, (wavelengths, slabs) = known[name]
        first, _ = seconds_of(model, dataclasses.replace(view))
        ours, literal = [], []
        for _ in range(2 if arguments.quick else 5):
            ours.append(seconds_of(model, dataclasses.replace(view)))
            if written_out is not None and len(literal) < (2 if slabs is None else 1):
                literal.append(written_out_seconds(written_out, view, wavelengths, slabs))
        wall, cpu = (statistics.median(times) for times in zip(*ours, strict=True))
        shape = {"width_px": size[0], "height_px": size[1]}
        for metric, value in (("seconds", wall), ("cpu_seconds", cpu), ("first_seconds", first)):
            record(metric, name, value, **shape)
        line = f"{name:20s} {wall:6.3f} s (first {first:.2f} s, CPU {cpu:.3f} s)"
        if written_out is not None:
            seconds, difference = statistics.median(literal), compare(model, written_out, small, slabs)
            record("written_out_cpu_seconds", name, seconds, **shape)
            record("speed_up", name, seconds / cpu, **shape)
            record("largest_difference", name, difference, width_px=SMALL[0], height_px=SMALL[1])
            line += f"; written out CPU {seconds:7.1f} s: {seconds / cpu:4.0f} x, differs by {difference:.2g}"
        print(line, file=sys.stderr, flush=True)
    document.write(records, quick=arguments.quick, where=arguments.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
