"""The command line: `uwsim COMMAND`. Every mistake in the input is one line on standard error and exit code 2."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from uwsim import __version__, pose_cli

app = typer.Typer(
    name="uwsim",
    help="Physics-based underwater image simulator and benchmark.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
app.add_typer(pose_cli.app, name="pose")

Out = Annotated[Path, typer.Option("--out", help="Folder to write to.")]
Variant = Annotated[
    str | None, typer.Option(help="Of Mitsuba: llvm_ad_spectral (default), or cuda_ad_spectral on a GPU.")
]
JsonOut = Annotated[str | None, typer.Option("--json", help="Write JSON to this file, - for standard output.")]


def main() -> None:
    """Run the command line; ValueError and OSError become one line and exit code 2."""
    try:
        # typer's own complaints (unknown option, missing argument) come as exceptions too, to be one line as well
        code = app(standalone_mode=False)
    except typer.Exit as stop:
        code = stop.exit_code
    except typer.Abort:
        _fail("stopped")
    except (ValueError, OSError) as error:
        _fail(str(error))
    except KeyboardInterrupt:
        _fail("interrupted", code=130)
    except Exception as error:
        if hasattr(error, "format_message") and hasattr(error, "exit_code"):  # a usage error of typer's parser
            _fail(f"{error.format_message() or _no_command(error)} (see `uwsim --help`)")
        raise
    sys.exit(code if isinstance(code, int) else 0)


def _no_command(error: Exception) -> str:
    """Return what to say of a bare group, whose help is printed but whose complaint is empty."""
    context = error.ctx
    group = context.command_path.removeprefix(context.find_root().command_path)
    return f"no command after `uwsim{group}`, allowed: {', '.join(context.command.list_commands(context))}"


def _fail(message: str, code: int = 2) -> None:
    sys.stderr.write(f"uwsim: {' '.join(message.split())}\n")
    sys.exit(code)


def _print(text: str = "") -> None:
    sys.stdout.write(text + "\n")


def _write_json(target: str, text: str) -> None:
    from uwsim.files import write_text

    if target == "-":
        sys.stdout.write(text)
        return
    _parent(Path(target))
    write_text(Path(target), text)


def _parent(path: Path) -> None:
    """Refuse an output whose folder does not exist, before any work is done."""
    if not path.resolve().parent.is_dir():
        raise ValueError(f"output {path}: the folder {path.parent} does not exist")
    if path.is_dir():
        raise ValueError(f"output {path}: is a folder, allowed: a file")


@app.callback(invoke_without_command=True)
def _version(version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False) -> None:
    if version:
        _print(__version__)
        raise typer.Exit


@app.command()
def doctor(json: JsonOut = None) -> None:
    """Say whether images can be rendered here; exit code 1 with the command that mends it if not."""
    import json as json_module

    from rich.console import Console
    from rich.table import Table

    from uwsim.render.doctor import diagnose

    diagnosis = diagnose()
    if json is not None:
        content = {
            "rows": [row._asdict() for row in diagnosis.rows],
            "problems": diagnosis.problems,
            "remedy": diagnosis.remedy,
        }
        _write_json(json, json_module.dumps(content, indent=1) + "\n")
    if json != "-":
        table = Table("what", "found", "state")
        for row in diagnosis.rows:
            table.add_row(row.what, row.value, row.state)
        Console().print(table)
    if diagnosis.problems:
        for problem in diagnosis.problems:
            sys.stderr.write(f"uwsim: {problem}\n")
        if diagnosis.remedy:
            sys.stderr.write(f"uwsim: to mend it, type: {diagnosis.remedy}\n")
        raise typer.Exit(1)


@app.command()
def schema(
    what: Annotated[str, typer.Argument(help="scene, recipe, benchmark or frame")] = "scene",
    out: Annotated[Path | None, typer.Option("--out", help="File to write; default: standard output.")] = None,
) -> None:
    """Write the JSON Schema of a TOML file (for editors) or of frame.json."""
    import json

    from uwsim.bench.definition import Definition
    from uwsim.dataset.info import FrameInfo
    from uwsim.dataset.recipe import Recipe
    from uwsim.scene.models import Scene

    models = {"scene": Scene, "recipe": Recipe, "benchmark": Definition, "frame": FrameInfo}
    if what not in models:
        raise ValueError(f"schema: got {what!r}, allowed: {', '.join(models)}")
    _write_json("-" if out is None else str(out), json.dumps(models[what].model_json_schema(), indent=1) + "\n")


@app.command()
def scenes() -> None:
    """List the scenes, recipes and benchmarks that ship with uwsim."""
    from uwsim.files import read_toml, shipped

    for title, folder in (("scenes", "scenes"), ("recipes", "scenes/datasets"), ("benchmarks", "benchmarks")):
        _print(title)
        for path in sorted(shipped(folder).glob("*.toml")):
            _print(f"  {path.stem:18} {read_toml(path).get('description', '')}")


@app.command()
def water(
    name: Annotated[str, typer.Argument(help="Name of a water type, such as tank_low, jerlov_III, petzold_harbor")],
    out: Annotated[Path | None, typer.Option("--out", help="PNG file: a, b, c and phase function.")] = None,
    particle_factor: Annotated[float, typer.Option(help="Particles, as a multiple of the type's.")] = 1.0,
    source: Annotated[str | None, typer.Option(help="Rival table of a Jerlov type.")] = None,
    json: JsonOut = None,
) -> None:
    """Print a water's coefficients and phase function; --out draws them."""
    import json as json_module

    from uwsim.optics import describe

    for target in (out, None if json in (None, "-") else Path(json)):
        if target is not None:
            _parent(target)
    if out is not None and out.suffix.lower() != ".png":
        raise ValueError(f"--out: got {out.name!r}, allowed: a name that ends in .png")
    numbers = describe.describe_named(name, particle_factor=particle_factor, source=source)
    if out is not None:
        from uwsim.optics.plots import plot_water
        from uwsim.optics.water import named_water

        plot_water(named_water(name, particle_factor=particle_factor, source=source), out)
    if json is not None:
        _write_json(json, json_module.dumps(numbers, indent=1) + "\n")
    if json != "-":
        _print(describe.as_text(numbers))


@app.command()
def optics(out: Out) -> None:
    """Write the optics page: waters, phase functions, lamp field, port, and the table of equations."""
    from uwsim import commands

    commands.write_optics_page(out)
    _print(f"{out / 'README.md'}")


@app.command()
def render(
    scene: Annotated[str, typer.Argument(help="TOML file, or the name of a shipped scene")],
    out: Out,
    samples: Annotated[int | None, typer.Option(help="Samples per pixel; 64 unless --noise or --time.")] = None,
    batches: Annotated[int | None, typer.Option(help="Independent batches of the samples; 8.")] = None,
    noise: Annotated[
        str | None, typer.Option(help="Until the error of region means is this small (1%), and pixels' for the sensor.")
    ] = None,
    time: Annotated[str | None, typer.Option(help="Stop after this time (60s, 5m), even if still too noisy.")] = None,
    checkpoint: Annotated[Path | None, typer.Option(help="File that keeps what is rendered so far.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on from the --checkpoint.")] = False,
    seed: Annotated[int, typer.Option(help="Seed of all random numbers.")] = 0,
    size: Annotated[str | None, typer.Option(help="WIDTHxHEIGHT instead of the scene's (same field of view).")] = None,
    orders: Annotated[
        bool, typer.Option("--orders", help="Also direct light without scattering, and light scattered once.")
    ] = False,
    denoise: Annotated[
        bool, typer.Option("--denoise", help="Denoise the scattered layers: biased, the bias is measured and stated.")
    ] = False,
    geometry_only: Annotated[
        bool, typer.Option("--geometry-only", help="Range, depth, normals, albedo, instances; needs no libLLVM.")
    ] = False,
    variant: Variant = None,
) -> None:
    """Render one scene by light transport: OUT becomes a frame folder (image.png, frame.exr, frame.json)."""
    from uwsim import commands, summaries

    until = commands.until(samples=samples, batches=batches, noise=noise, time=time)
    loaded = commands.sized_scene(scene, size)
    text = f"{out}: {loaded.name}, {loaded.rig.camera.width_px} x {loaded.rig.camera.height_px}"
    if geometry_only:
        light = {"samples": samples, "batches": batches, "noise": noise, "time": time, "checkpoint": checkpoint}
        light |= {"orders": orders or None, "denoise": denoise or None, "variant": variant}
        if given := [f"--{name}" for name, value in light.items() if value is not None]:
            raise ValueError(f"--geometry-only: got {', '.join(given)} too, allowed: no options about light")
        commands.render_geometry(loaded, out)
        _print(text)
        return
    with _progress() as report:
        found = commands.render_scene(
            loaded, out, until=until, seed=seed, report=report, checkpoint=checkpoint, resume=resume, orders=orders,
            denoise=denoise, variant=variant,
        )  # fmt: skip
    _print(f"{text}\n{summaries.noise_line(found.noise)}")
    if line := summaries.denoised_line(found.options):
        _print(line)


@app.command()
def generate(
    recipe: Annotated[str, typer.Argument(help="TOML file, or the name of a shipped recipe")],
    out: Out,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with a dataset that was begun in OUT.")] = False,
    workers: Annotated[int, typer.Option(min=1, help="Processes that make frames side by side.")] = 1,
    threads: Annotated[
        int | None, typer.Option(min=1, help="Rendering threads of each; default: all cores, shared out.")
    ] = None,
    cluster: Annotated[
        str | None, typer.Option(help="Address of a Dask scheduler (tcp://...), whose workers make the frames.")
    ] = None,
    variant: Variant = None,
) -> None:
    """Generate a labelled dataset; killed and resumed, or made by many, it has the same bytes."""
    from uwsim import commands, summaries

    with _progress() as report:
        dataset = commands.generate_dataset(
            recipe, out, resume=resume, report=report, variant=variant, workers=workers, threads=threads,
            cluster=cluster,
        )  # fmt: skip
    _print(f"{out}: {len(dataset)} frames")
    for line in (summaries.noisy_frames_line(dataset), summaries.mixed_processors_line(dataset)):
        if line:
            _print(line)
    if line := summaries.failed_frames_line(dataset):
        sys.stderr.write(f"uwsim: {line}\n")
        raise typer.Exit(1)


@app.command()
def check(folder: Annotated[Path, typer.Argument(help="Dataset folder")]) -> None:
    """Verify a dataset: checksums, shapes, finiteness, agreement of the parts."""
    from uwsim.dataset.check import check as check_dataset

    _print(f"{folder}: {check_dataset(folder)} frames, sound")


@app.command()
def gallery(
    folder: Annotated[Path, typer.Argument(help="Dataset folder")],
    out: Annotated[Path | None, typer.Option("--out", help="Folder to write to; default: gallery/ in FOLDER.")] = None,
    workers: Annotated[int, typer.Option(min=1, help="Processes that draw frames side by side.")] = 1,
) -> None:
    """Write a static page to look through a dataset; killed and started again, it goes on where it was."""
    from uwsim.gallery.make import write

    with _progress() as report:
        written = write(folder, out, processes=workers, progress=lambda done, total: report("gallery", done, total))
    _print(f"open {written.page}: {written.frames} frames, {written.made} previews made")


@app.command()
def export(
    folder: Annotated[Path, typer.Argument(help="Dataset folder")],
    format: Annotated[str, typer.Option(help="bop, coco, pairs, webdataset, euroc or tum")],
    out: Out,
    split: Annotated[
        str | None, typer.Option(help="Shares of the scenes, such as train=0.8,val=0.1,test=0.1; all in train.")
    ] = None,
    silhouettes: Annotated[
        bool, typer.Option("--silhouettes", help="bop: also whole silhouettes, by casting rays in the recipe's scenes.")
    ] = False,
) -> None:
    """Write a dataset in a format of others; OUT is complete or absent."""
    from uwsim.export.run import export as export_dataset
    from uwsim.export.splits import shares_from_text

    shares, whole = None if split is None else shares_from_text(split), None
    if silhouettes:
        from uwsim.dataset.silhouettes import silhouettes as whole
    with _progress() as report:
        summary = export_dataset(folder, out, format=format, shares=shares, progress=report, silhouettes=whole)
    _print(f"{out}: {summary}")


@app.command()
def bench(
    name: Annotated[
        str, typer.Argument(help="A name that `uwsim scenes` lists, such as restoration, or a benchmark's TOML file")
    ],
    dataset: Annotated[Path | None, typer.Option(help="Dataset folder; default: the one the benchmark names.")] = None,
    algorithm: Annotated[list[str] | None, typer.Option(help="Name, or path of your own .py file; repeatable.")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="A reduced run of a few cases.")] = False,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="Folder for the page: restoration, validity, blur..., pose..., pnp...; or sheets."),
    ] = None,
    photos: Annotated[
        Path | None, typer.Option(help="restoration: folder of real photographs and videos instead of a dataset.")
    ] = None,
    every: Annotated[
        int | None, typer.Option(min=1, help="Of videos every n-th frame, 1 for all; default: as their layout says.")
    ] = None,
    simulated: Annotated[
        Path | None, typer.Option(help="Result on simulated pictures, to compare its ranking with that on videos.")
    ] = None,
    checkpoint: Annotated[Path | None, typer.Option(help="File that keeps the scores of finished cases.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on from the --checkpoint.")] = False,
    workers: Annotated[int, typer.Option(min=1, help="Processes that score cases side by side.")] = 1,
    json: JsonOut = None,
) -> None:
    """Score algorithms against the truth: a Markdown table, tidy JSON with --json, a page of figures with --out."""
    from uwsim import commands

    if json not in (None, "-"):
        _parent(Path(json))
    of_datasets = {"dataset": dataset, "quick": quick, "checkpoint": checkpoint, "resume": resume}
    of_datasets |= {"workers": workers > 1}
    others = {"every": every, "simulated": simulated} if photos is None else of_datasets
    if given := [f"--{key}" for key, value in others.items() if value not in (None, False)]:
        raise ValueError(f"{', '.join(given)}: allowed only {'with' if photos is None else 'without'} --photos")
    with _progress() as report:
        if photos is not None:
            result = commands.run_on_photographs(
                name, photos, algorithms=algorithm, every=every, simulated=simulated, out=out, report=report
            )
        else:
            result = commands.run_benchmark(
                name, dataset, algorithms=algorithm, quick=quick, report=report, out=out, checkpoint=checkpoint,
                resume=resume, workers=workers,
            )  # fmt: skip
    if json is not None:
        _write_json(json, result.to_json())
    if json != "-":
        from uwsim.bench.records import markdown

        _print(markdown(result))


@app.command()
def restore(
    method: Annotated[str, typer.Argument(help="Name of a restoration method, or the path of your own .py file")],
    images: Annotated[list[Path], typer.Argument(help="8-bit colour photographs")],
    out: Out,
    json: JsonOut = None,
) -> None:
    """Restore photographs and print their no-reference scores, before and after."""
    from uwsim import photographs

    if json not in (None, "-"):
        _parent(Path(json))
        photographs.check_table(Path(json), images, out)
    with _progress() as report:
        rows = photographs.restore_photographs(method, images, out, report=report)
    if json is not None:
        import json as json_module

        _write_json(json, json_module.dumps(rows, indent=1) + "\n")
    if json != "-":
        _print(photographs.restoration_table(rows))


@app.command()
def deblur(
    method: Annotated[str, typer.Argument(help="Name of a deconvolution method, or the path of your own .py file")],
    images: Annotated[list[Path], typer.Argument(help="8-bit colour photographs")],
    out: Out,
    estimator: Annotated[str | None, typer.Option(help="Says how each picture is blurred; default: whittle.")] = None,
    length_px: Annotated[float | None, typer.Option(help="Length of the blur, if known; with --angle-deg.")] = None,
    angle_deg: Annotated[float | None, typer.Option(help="Its direction: x right, y up, modulo 180.")] = None,
    json: JsonOut = None,
) -> None:
    """Undo straight motion blur of photographs, tile by tile where it differs, and print what it was taken to be."""
    from uwsim import photographs

    if json not in (None, "-"):
        _parent(Path(json))
        photographs.check_table(Path(json), images, out)
    with _progress() as report:
        rows = photographs.deblur_photographs(
            method, images, out, estimator=estimator, length_px=length_px, angle_deg=angle_deg, report=report
        )
    if json is not None:
        import json as json_module

        _write_json(json, json_module.dumps(rows, indent=1) + "\n")
    if json != "-":
        _print(photographs.deblurring_table(rows))


@app.command()
def report(
    dataset: Annotated[Path, typer.Option(help="Dataset folder.")],
    out: Annotated[Path, typer.Option("--out", help="HTML file to write.")],
    bench: Annotated[list[Path] | None, typer.Option(help="Result of `uwsim bench --json`; repeatable.")] = None,
) -> None:
    """Write one static page: frames beside their truth, scores, plots, environment."""
    from uwsim import commands

    _parent(out)
    commands.write_page(dataset, out, [commands.read_result(path) for path in bench or []])
    _print(f"{out}")


@app.command()
def demo(
    out: Out = Path("demo"),
    show: Annotated[bool, typer.Option("--show", help="Open gallery and report in the browser, if any.")] = False,
) -> None:
    """The whole loop: render a small dataset, score the algorithms, write report and gallery (a few minutes)."""
    from uwsim import demonstration

    with _progress() as report:
        page, gallery = demonstration.demonstrate(out, report=report)
    opened = [show and demonstration.show(one) for one in (page, gallery)]
    _print(f"{'opened' if all(opened) else 'open'} {page} and {gallery}")


def _progress():
    """Return a context manager that gives `report(text, done, total)`, drawn as a bar on standard error."""
    from uwsim.progress import bar

    return bar()


if __name__ == "__main__":
    main()
