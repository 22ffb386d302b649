"""What the commands of `uwsim.cli` do, without printing."""

import re
import tempfile
from dataclasses import asdict
from functools import partial
from pathlib import Path

from uwsim.progress import Report
from uwsim.provenance import thread_count


def sized_scene(name: str, size: str | None):
    """Return a scene, its camera resized to `WIDTHxHEIGHT` with the same horizontal field of view if given."""
    from uwsim.scene.load import load_scene, scene_values
    from uwsim.scene.models import Scene
    from uwsim.validation import validated

    if size is None:
        return load_scene(name)
    match = re.fullmatch(r"(\d{1,5})x(\d{1,5})", size)
    if not match:
        raise ValueError(f"--size: got {size!r}, allowed: WIDTHxHEIGHT such as 320x240")
    values, path = scene_values(name)
    scene = validated(Scene, values, where=path)
    if scene.rig.camera.K_px is not None:
        raise ValueError(f"--size: {path} gives K_px, which belongs to one image size; change the file instead")
    values["rig"]["camera"] |= {"width_px": int(match[1]), "height_px": int(match[2])}
    return validated(Scene, values, where=f"--size {size}")


def _new_folder(out: Path) -> None:
    if out.exists():
        raise ValueError(f"--out {out}: exists already, allowed: a new folder")
    require_folder(out)


def require_folder(out: Path) -> None:
    """Raise ValueError unless `out` is a folder, or could be made."""
    if not out.resolve().parent.is_dir():
        raise ValueError(f"--out {out}: the folder {out.parent} does not exist")
    if out.exists() and not out.is_dir():
        raise ValueError(f"--out {out}: is a file, allowed: a folder")


def until(*, samples: int | None, batches: int | None, noise: str | None, time: str | None):
    """Return what ends a render from the options of the command line: samples in batches, or noise and time.

    Without any: 64 samples in 8 batches. Raises ValueError if both kinds are given.
    """
    from uwsim.render import stopping

    if noise is None and time is None:
        return stopping.until(64 if samples is None else samples, 8 if batches is None else batches, None)
    for name, value in (("--samples", samples), ("--batches", batches)):
        if value is not None:
            raise ValueError(f"{name}: got {value} with {'--noise' if noise else '--time'}, allowed: one or the other")
    return stopping.Until(
        region=None if noise is None else stopping.share_from_text(noise),
        time_s=None if time is None else stopping.seconds_from_text(time),
    )


def render_scene(
    scene, out: Path, *, until, seed: int, report: Report, checkpoint: Path | None = None, resume: bool = False,
    orders: bool = False, denoise: bool = False, variant: str | None = None,
):  # fmt: skip
    """Render a scene into a new frame folder `out` and return its description (frame.json).

    until: what ends it (`render.stopping.Until`). checkpoint: file to keep the sums in; `resume` goes on from it.
    orders, denoise: as in `render.smooth.Options`. variant: of Mitsuba, as in `light_variant`.
    """
    from uwsim.dataset.frame import write_frame
    from uwsim.dataset.make import make_frame
    from uwsim.render import checkpoint as checkpoints
    from uwsim.render import smooth, variants

    options = smooth.Options(orders=orders, denoise=denoise)
    if denoise:
        smooth.require_denoiser()
    _new_folder(out)
    if resume and checkpoint is None:
        raise ValueError("--resume: got no --checkpoint, allowed: with the --checkpoint FILE to go on from")
    variant, kept = variants.use(light_variant(variant)), None
    if checkpoint is not None:
        identity = checkpoints.identity(
            scene, seed=seed, frame=0, samples_per_batch=until.samples_per_batch, variant=variant
        ) | {"options": ", ".join(name for name, asked in asdict(options).items() if asked) or "none"}
        kept = checkpoints.Checkpoint(checkpoint, identity=identity, resume=resume)
    made = make_frame(
        scene, name=out.name, group="single", seed=seed, frame=0, until=until, checkpoint=kept, options=options,
        progress=lambda what, done, total: report(f"{scene.name}: {what}", done, total),
    )  # fmt: skip
    write_frame(out, **made)
    return made["info"]


def render_geometry(scene, out: Path) -> None:
    """Cast rays and write the geometry buffers to `out`/geometry.exr; works without libLLVM."""
    from uwsim.dataset import exr
    from uwsim.dataset.frame import BUFFERS
    from uwsim.render import film, geometry, memory, placement, variants

    _new_folder(out)
    memory.require_memory(width_px=scene.rig.camera.width_px, height_px=scene.rig.camera.height_px)
    variants.use(geometry=True)
    placement.check(scene)
    view = film.view_of(scene)
    buffers = geometry.geometry(scene, view)
    out.mkdir()
    exr.write(out / "geometry.exr", {name: (image, BUFFERS[name][1]) for name, image in buffers.items()})


def light_variant(name: str | None) -> str | None:
    """Return the name of a Mitsuba variant that renders light; ValueError for others. None stands for the default."""
    allowed = ("llvm_ad_spectral", "cuda_ad_spectral")
    if name is not None and name not in allowed:
        raise ValueError(f"--variant: got {name!r}, allowed: {', '.join(allowed)}")
    return name


def generate_dataset(
    recipe: str, out: Path, *, resume: bool, report: Report, variant: str | None = None, workers: int = 1,
    threads: int | None = None, cluster: str | None = None,
):  # fmt: skip
    """Generate (or finish) a dataset and return it; `variant` of Mitsuba as in `render_scene`.

    workers: processes on this machine; threads: of each, all cores shared out if None. cluster: address of a Dask
    scheduler, whose workers make the frames instead.
    """
    from uwsim.dataset import runners
    from uwsim.dataset.cluster import on_cluster
    from uwsim.dataset.generate import generate
    from uwsim.dataset.recipe import load_recipe
    from uwsim.render import variants

    if cluster is not None and workers != 1:
        raise ValueError(f"--workers: got {workers} with --cluster, allowed: one or the other")
    loaded, path = load_recipe(recipe)
    require_folder(out)
    variant = variants.use(light_variant(variant))
    if cluster is None:
        threads = threads or max(1, thread_count() // workers)
        variants.set_threads(threads)

    def picture(number, frames, what, done, total):
        left = loaded.frames - frames  # there before this run
        report(
            f"{loaded.name}: frame {left + number + 1} of {loaded.frames}, {what}", (left + number) * total + done,
            loaded.frames * total,
        )  # fmt: skip

    def done(there, frames):
        report(f"{loaded.name}: {there} of {frames} frames", there, frames)

    if cluster is not None:
        run = partial(on_cluster, address=cluster, dataset=out, variant=variant, threads=threads)
    elif workers > 1:
        run = partial(runners.by_processes, processes=workers, threads=threads, variant=variant)
    else:
        return generate(loaded, out, where=path, resume=resume, run=partial(runners.here, progress=picture))
    return generate(loaded, out, where=path, resume=resume, run=run, side_by_side=workers, done=done)


def run_benchmark(
    name: str, dataset: Path | None, *, algorithms: list[str] | None, quick: bool, report: Report,
    out: Path | None = None, checkpoint: Path | None = None, resume: bool = False,
    workers: int = 1,
):  # fmt: skip
    """Score a benchmark on a dataset; without one, on that which the benchmark names, generated under out/.

    A benchmark that makes its frames takes none.
    quick: on few cases, of the benchmark's `quick_dataset` if it has one. out: folder for the page.
    checkpoint, resume, workers: as in `bench.run.run`.
    """
    from uwsim.bench.definition import read_definition
    from uwsim.bench.run import run
    from uwsim.dataset import store

    definition = read_definition(name)[1]
    if out is not None:
        require_folder(out)
        page = page_of(name, definition.task, algorithms=algorithms)
    if dataset is None and definition.made_from is None:
        recipe = definition.quick_dataset if quick and definition.quick_dataset else definition.dataset
        dataset = Path("out") / Path(recipe).stem
        dataset.parent.mkdir(exist_ok=True)
        generate_dataset(recipe, dataset, resume=True, report=report)
    opened = None if dataset is None else store.open(dataset)
    result = run(
        name, opened, algorithms=algorithms, quick=quick, progress=report, checkpoint=checkpoint, resume=resume,
        workers=workers,
    )  # fmt: skip
    if out is not None:
        report("page", 0, 1)
        page.write(out, result=result, dataset=opened)
    return result


def run_on_photographs(
    name: str, folder: Path, *, algorithms: list[str] | None, every: int | None, simulated: Path | None,
    out: Path | None, report: Report,
):  # fmt: skip
    """Score restorations on a folder of photographs and videos; arguments as in `bench.photos.run.run`."""
    from uwsim.bench.photos.run import run

    if out is not None:
        require_folder(out)
    return run(name, folder, algorithms=algorithms, every=every, simulated=simulated, out=out, progress=report)


def page_of(name: str, task: str, *, algorithms: list[str] | None):
    """Return the module whose `write` makes the page of a benchmark; ValueError unless there is one for such a run."""
    from uwsim.bench.blur_page import page as of_blur
    from uwsim.bench.pnp_outliers import page as of_outliers
    from uwsim.bench.pnp_page import page as of_pnp
    from uwsim.bench.pose_page import page as of_pose
    from uwsim.bench.restoration_page import page as of_restoration
    from uwsim.bench.validity import page as of_validity

    if task == "restoration":
        return of_restoration
    if task in of_blur.TASKS:
        return of_blur
    if task in of_pnp.TASKS:
        return of_pnp
    if task in of_outliers.TASKS:
        return of_outliers
    if task in of_pose.TASKS:
        return of_pose
    of_validity.check(name, algorithms=algorithms)
    return of_validity


def read_result(path: Path) -> dict:
    """Read a result of `uwsim bench --json`."""
    from uwsim.bench.records import read_result as read

    return read(path).to_dict()


def write_page(dataset: Path, out: Path, results: list[dict], *, gallery: str | None = None) -> None:
    """Write the report of a dataset and of benchmark results on it; `gallery`: address of one to link to."""
    from uwsim.bench.report import write_report
    from uwsim.dataset import store

    opened = store.open(dataset)
    environment = {key: opened.manifest[key] for key in ("versions", "machine", "commit")}
    write_report(out, dataset=opened, results=results, environment=environment, gallery=gallery)


def write_optics_page(out: Path) -> None:
    """Write the optics page into `out`: figures of waters, phase functions, lamp field and port, and README.md."""
    import shutil

    from uwsim import optics_page

    require_folder(out)
    with tempfile.TemporaryDirectory(dir=out.resolve().parent) as folder:
        optics_page.write(Path(folder))
        out.mkdir(exist_ok=True)
        for file in sorted(Path(folder).iterdir()):
            shutil.move(file, out / file.name)
