"""Time to equal error: the renderer against Mitsuba's `volpath` and `volpathmis`, side by side in one run.

    python benchmarks/speed/render.py [--quick] [--attenuation 1 3 6] [--json -]

Scene: `tank_usaf`, grey water of attenuation c, albedo 0.8, Petzold's average particle. Two set-ups of the peers:
  same   our emitter (LED of 3 mm radius behind a flat window) and our flat port, without the housings' shadow
  user   a bare point lamp and a pinhole, both in the water
and one of ours, that of `same`. Rounds of all algorithms alternate; a round's time does not hold compilation. A peer's
error is that against the converged picture of its own set-up (by our integrator, independent seeds, whose own error is
subtracted from the squares and printed). Squared error x time is what equal error costs, as long as the error falls as
1/N; the slopes show whether it does. Rare bright samples that a peer's rounds happen to miss flatter the peer.
"""

import argparse
import sys
import time

import document
import numpy as np

PEERS = ("volpath", "volpathmis")
ALBEDO = 0.8
REGIONS = 8
DARK = 0.01  # of the mean: the floor of relative errors


def scene_of(setup: str, *, width_px: int, height_px: int):
    """Return `tank_usaf` with a bare lamp and pinhole ("user"), or with window and port ("same")."""
    from uwsim.scene.load import scene_values
    from uwsim.scene.models import Scene

    values, _ = scene_values("tank_usaf")
    values["rig"]["camera"] |= {"width_px": width_px, "height_px": height_px}
    if setup == "same":
        # the glass of port and window ends in the plane of the pinhole and lamp of the other set-up, 40 mm before them
        values["rig"]["camera"]["port"] = {"kind": "flat", "gap_m": 0.03, "thickness_m": 0.01}
        values["rig"]["camera"]["horizontal_fov_deg"] = 66.0
        lamp = values["rig"]["lamps"][0]
        lamp["window"] = {"kind": "flat", "air_gap_m": 0.03, "thickness_m": 0.01, "radius_m": 0.045}
        lamp["die_radius_m"] = 0.003
    return Scene.model_validate(values)


class Setup:
    """A scene in water, its picture by every algorithm, and its converged picture."""

    def __init__(self, name: str, *, attenuation_per_m: float, width_px: int, height_px: int):
        from uwsim.optics.water import Water, petzold_mixture
        from uwsim.render import film
        from uwsim.render.build import build

        scene = scene_of(name, width_px=width_px, height_px=height_px)
        flat = np.full(61, attenuation_per_m)
        water = Water("grey", flat * (1 - ALBEDO), flat * ALBEDO, petzold_mixture("average"))
        self.built = build(scene, water=water, rig_poses=scene.rig.world_from_rig[None])
        self.view = film.view_of(scene)

    def picture(self, algorithm: str, *, samples: int, batches: int, seed: int):
        """Return the sums of a picture."""
        from uwsim.render import transport
        from uwsim.render.accumulate import accumulate

        estimate = transport.estimate(self.built) if algorithm == "uwsim" else self._peer(algorithm)
        return accumulate(self.built, self.view, estimate, samples_per_pixel=samples, batches=batches, seed=seed)

    def _peer(self, name: str):
        import mitsuba as mi

        from uwsim.render.build import integrator_description

        integrator = mi.load_dict(integrator_description(name))
        built = self.built
        return lambda rays, sampler: [integrator.sample(built.scene, sampler, rays, built.medium, True)[0]]

    def converge(self, *, samples: int) -> None:
        sums = self.picture("uwsim", samples=samples, batches=16, seed=987654321)
        self.truth = sums.means[0]
        self.variance = sums.standard_error() ** 2
        regions = sums.region_sums / sums.batches
        self.regions = regions
        self.region_variance = np.maximum(sums.region_squares / sums.batches - regions**2, 0) / (sums.batches - 1)

    def errors(self, sums) -> dict[str, float]:
        """Return relMSE of pixels and of region means, the converged picture's own error taken off."""
        floor = DARK * self.truth.mean()
        pixel = (sums.means[0] - self.truth) ** 2 - self.variance
        region = (sums.region_sums / sums.batches - self.regions) ** 2 - self.region_variance
        return {
            "pixels": float(np.mean(pixel / (self.truth**2 + floor**2))),
            "regions": float(np.mean(region / (self.regions**2 + floor**2))),
        }

    def own_error(self) -> dict[str, float]:
        floor = DARK * self.truth.mean()
        return {
            "pixels": float(np.mean(self.variance / (self.truth**2 + floor**2))),
            "regions": float(np.mean(self.region_variance / (self.regions**2 + floor**2))),
        }


def measure(setups: dict[str, Setup], *, samples: dict[str, int], rounds: int, say) -> dict:
    """Return seconds and errors of every (set-up, algorithm), rounds alternating."""
    runs = [("same", "uwsim"), *((setup, peer) for setup in setups for peer in PEERS)]
    found = {run: {"seconds": [], "pixels": [], "regions": []} for run in runs}
    for setup, algorithm in runs:
        setups[setup].picture(algorithm, samples=samples[algorithm], batches=2, seed=1)  # compiles
    for index in range(rounds):
        for setup, algorithm in runs:
            started = time.perf_counter()
            sums = setups[setup].picture(algorithm, samples=samples[algorithm], batches=2, seed=100 + index)
            found[setup, algorithm]["seconds"].append(time.perf_counter() - started)
            for key, value in setups[setup].errors(sums).items():
                found[setup, algorithm][key].append(value)
        say(f"  round {index + 1} of {rounds}")
    return found


def slope(setup: Setup, *, samples: int, octaves: int, rounds: int) -> dict[str, float]:
    """Return the log-log slopes of the squared errors over octaves of samples."""
    points = {"pixels": [], "regions": []}
    for octave in range(octaves + 1):
        errors = [
            setup.errors(setup.picture("uwsim", samples=samples << octave, batches=2, seed=5000 + 100 * octave + k))
            for k in range(max(2, rounds >> octave))
        ]
        for key in points:
            points[key].append(max(np.mean([e[key] for e in errors]), 1e-12))
    octaves_log = np.log([samples << octave for octave in range(octaves + 1)])
    return {key: float(np.polyfit(octaves_log, np.log(values), 1)[0]) for key, values in points.items()}


def compile_times(*, width_px: int, height_px: int) -> dict[str, float]:
    """Return seconds of the first picture of a kind, and of one after turbidity, lamp and pose have changed."""
    seconds = []
    for attenuation in (1.0, 1.1, 1.2):
        setup = Setup("same", attenuation_per_m=attenuation, width_px=width_px, height_px=height_px)
        started = time.perf_counter()
        setup.picture("uwsim", samples=2, batches=2, seed=1)
        seconds.append(time.perf_counter() - started)
        del setup
    return {"first": seconds[0], "changed": min(seconds[1:])}


def frames_per_hour(*, noise: float) -> float:
    """Return 640x480 pictures of `tank_usaf` as shipped per hour at a region error, from a measured picture.

    One picture of 16 samples is rendered; its region error falls as the root of the samples.
    """
    from uwsim.render import film, stopping, transport
    from uwsim.render.accumulate import accumulate
    from uwsim.render.build import build
    from uwsim.scene.load import load_scene

    scene = load_scene("tank_usaf")
    built = build(scene, water=scene.water.optical(), rig_poses=scene.rig.world_from_rig[None])
    view = film.view_of(scene)
    estimate = transport.estimate(built)
    accumulate(built, view, estimate, samples_per_pixel=2, batches=2, seed=1)
    started = time.perf_counter()
    sums = accumulate(built, view, estimate, samples_per_pixel=16, batches=8, seed=2)
    seconds = time.perf_counter() - started
    error = stopping.region_error(sums.region_sums, sums.region_squares, batches=sums.batches, dark=0.0)
    return 3600 / (seconds * (error / noise) ** 2)


def main() -> int:
    """Measure, print a table, write tidy records."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="small pictures, few rounds: shows that it runs")
    parser.add_argument("--attenuation", type=float, nargs="+", default=[1.0, 3.0, 6.0], help="c [1/m]")
    parser.add_argument("--json", help="where to write the records; - for standard output")
    parser.add_argument("--no-frames", action="store_true", help="without the 640x480 pictures")
    arguments = parser.parse_args()
    from uwsim.render import variants

    variants.use()
    size = {"width_px": 24, "height_px": 16} if arguments.quick else {"width_px": 48, "height_px": 32}
    rounds, converged = (2, 512) if arguments.quick else (6, 4096)
    # the peers' error sits in rare bright samples: with few samples they are missed, and the peers look better
    peers = 512 if arguments.quick else 2048
    samples = {"uwsim": 64, "volpath": peers, "volpathmis": peers}

    def say(text: str) -> None:
        print(text, file=sys.stderr, flush=True)

    records = []

    def record(metric: str, algorithm: str, value: float, **sweep) -> None:
        records.append({"benchmark": "speed/render", "metric": metric, "algorithm": algorithm, **sweep, "value": value})

    for attenuation in arguments.attenuation:
        setups = {name: Setup(name, attenuation_per_m=attenuation, **size) for name in ("same", "user")}
        for name, setup in setups.items():
            started = time.perf_counter()
            setup.converge(samples=converged)
            own = setup.own_error()
            say(f"c = {attenuation:g}/m, {name}: converged in {time.perf_counter() - started:.0f} s, own relMSE "
                f"{own['pixels']:.2g}, of regions {own['regions']:.2g}")  # fmt: skip
            for error, value in own.items():
                record(
                    "converged_squared_error", "uwsim", value, attenuation_per_m=attenuation, setup=name, error=error
                )
        found = measure(setups, samples=samples, rounds=rounds, say=say)
        for (name, algorithm), values in found.items():
            seconds = float(np.mean(values["seconds"]))
            record("seconds", algorithm, seconds, attenuation_per_m=attenuation, setup=name)
            for error in ("pixels", "regions"):
                cost = seconds * float(np.mean(values[error]))
                record("squared_error", algorithm, float(np.mean(values[error])), attenuation_per_m=attenuation,
                       setup=name, error=error)  # fmt: skip
                ours = float(np.mean(found["same", "uwsim"]["seconds"])) * float(np.mean(found["same", "uwsim"][error]))
                if algorithm != "uwsim":
                    record("time_to_equal_error_ratio", algorithm, cost / ours, attenuation_per_m=attenuation,
                           setup=name, error=error)  # fmt: skip
                    say(f"  {name}, {algorithm}, {error}: {cost / ours:.3g} x our time to equal error")
        slopes = slope(setups["same"], samples=8, octaves=3, rounds=4 * rounds)
        for error, value in slopes.items():
            record("convergence_slope", "uwsim", value, attenuation_per_m=attenuation, setup="same", error=error)
        say(f"  slopes of the squared error over three octaves: {slopes}")
        del setups
    for kind, seconds in compile_times(**size).items():
        record("compile_seconds", "uwsim", seconds, scene=kind)
        say(f"first picture, scene {kind}: {seconds:.2f} s")
    if not arguments.no_frames and not arguments.quick:
        record("frames_per_hour_640x480_1_percent", "uwsim", frames_per_hour(noise=0.01), scene="tank_usaf")
        say(f"frames per hour at 640x480 and 1 % region error: {records[-1]['value']:.3g}")
    document.write(records, quick=arguments.quick, where=arguments.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
