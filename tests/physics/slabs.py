"""Plane-parallel water lit by the sun, and what rays through its faces see: irradiances and radiances by depth."""

import numpy as np

from tests.physics import scenes
from uwsim.render.build import build
from uwsim.scene.models import Scene

WAVELENGTHS_OF_RAYS_NM = (450.0, 500.0, 550.0, 600.0)
PER_NM = 1 / 300.0
"""A flat spectrum of 1 W over 400-700 nm, per nm."""


def tabulated(*, absorption_per_m: float, scattering_per_m: float, phase: dict) -> dict:
    """Return the description of grey water."""
    return {
        "wavelengths_nm": (400.0, 700.0),
        "absorption_per_m": (absorption_per_m,) * 2,
        "scattering_per_m": (scattering_per_m,) * 2,
        "phase": phase,
    }


def scene_under(
    daylight: dict, *, water: dict, refractive_index: float, added: tuple = (), bodies: tuple = ()
) -> Scene:
    """Return water under sun and sky with a flat spectrum; a black speck far away stands for the body it must have."""
    speck = {
        "name": "speck", "kind": "rectangle", "width_m": 1e-3, "height_m": 1e-3, "reflectance": 0.0,
        "position_m": [300.0, 300.0, -300.0],
    }  # fmt: skip
    camera = {"width_px": 4, "height_px": 4, "horizontal_fov_deg": 1.0, "response": scenes.RESPONSE}
    return Scene.model_validate(
        {
            "name": "slab",
            "description": "plane-parallel water",
            "water": water | {"refractive_index": refractive_index},
            "added_water": added,
            "rig": {"position_m": (0.0, 0.0, -0.5), "look_at_m": (0.0, 1.0, -0.5), "camera": camera},
            "bodies": bodies or (speck,),
            "daylight": {"spectrum": "E"} | daylight,
            "exposure": {"time_s": 0.01},
        }
    )


def slab(*, depth: float, albedo: float, phase: dict, sun_cosine: float = 1.0) -> Scene:
    """Return an index-matched layer of 1 /m in empty space below z = 0, the sun 1 W/m^2 on a horizontal plane."""
    layer = {
        "name": "slab", "kind": "layer", "top_water_depth_m": 0.0, "bottom_water_depth_m": depth,
        "water": tabulated(absorption_per_m=1 - albedo, scattering_per_m=albedo, phase=phase),
    }  # fmt: skip
    sun = {"sun_irradiance_w_per_m2": 1.0, "sun_zenith_deg": float(np.degrees(np.arccos(sun_cosine)))}
    nothing = tabulated(absorption_per_m=0.0, scattering_per_m=0.0, phase=phase)
    return scene_under(sun, water=nothing, added=(layer,), refractive_index=1.0)


def radiances(scene: Scene, *, depth_m: float, directions: np.ndarray, seeds: int) -> np.ndarray:
    """Return the radiance of light that arrives at a depth against given directions of view, over the sun's 1 W/m^2.

    directions (seeds, n, 3): unit vectors in which the rays go, those of one seed a replicate. Result (seeds, n).
    """
    import mitsuba as mi

    from uwsim.render.integrator import LampWalk

    built = build(scene, water=scene.water.optical(), rig_poses=scene.rig.world_from_rig[None])
    walk, sampler, found = LampWalk(built), mi.load_dict({"type": "independent"}), []
    for seed in range(seeds):
        count = directions.shape[1]
        sampler.seed(seed, count)
        rays = mi.Ray3f(mi.Point3f(0.0, 0.0, -depth_m), mi.Vector3f(directions[seed].T.astype(np.float32)))
        rays.time, rays.wavelengths = mi.Float(0.5), mi.Spectrum(*WAVELENGTHS_OF_RAYS_NM)
        layers = walk(rays, sampler)[:3]
        total = sum(layers[1:], layers[0])
        found.append(np.array(total).mean(axis=0) / PER_NM)
    return np.array(found)


def into(side: int, *, cosine_power: int, seeds: int, count: int) -> np.ndarray:
    """Return directions (seeds, count, 3) into the upper (1) or lower (-1) hemisphere with density ~ cosine^power."""
    rng = np.random.default_rng([cosine_power, side + 1])
    # stratified over each seed's rays: the seeds stay independent
    order = (np.arange(count) + rng.random((seeds, count))) / count
    cosine = order ** (1 / (cosine_power + 1))
    angle = 2 * np.pi * rng.random((seeds, count))
    sine = np.sqrt(1 - cosine**2)
    return np.stack([sine * np.cos(angle), sine * np.sin(angle), side * cosine], axis=-1)


def irradiance(
    scene: Scene, *, depth_m: float, side: int, seeds: int, count: int, scalar: bool = False, peak=None
) -> np.ndarray:
    """Return the scattered irradiance at a depth from above (side 1) or from below (-1), plane or scalar, (seeds,).

    peak: phase function about whose forward direction the light from the sun piles up; half of the rays are then drawn
    by it around the sun, both kinds weighted by the density of the mixture.
    """
    power = 0 if scalar else 1
    directions = into(side, cosine_power=power, seeds=seeds, count=count)
    weights = np.full((seeds, count), np.pi * (2 if scalar else 1))
    if peak is not None:
        rng = np.random.default_rng(seeds)
        drawn = rng.random((2, seeds, len(range(0, count, 2))))
        directions[:, ::2] = _around(sun_in_water(scene), peak, *drawn)  # the others stay stratified
        cosine = np.maximum(side * directions[..., 2], 0.0)
        # the distance of two tips keeps the digits of a small angle
        apart = np.linalg.norm(directions - sun_in_water(scene), axis=-1)
        towards = np.maximum(2 * np.arcsin(np.minimum(apart / 2, 1.0)), 1e-9)
        even = cosine**power * (power + 1) / (2 * np.pi)
        weights = cosine**power / (0.5 * even + 0.5 * peak.density(towards))
    return (radiances(scene, depth_m=depth_m, directions=directions, seeds=seeds) * weights).mean(axis=1)


def sun_in_water(scene: Scene) -> np.ndarray:
    """Return the unit vector to the sun below the surface, (3,)."""
    across = scene.daylight.towards_sun_in_air[:2] / scene.water.refractive_index
    return np.array([*across, np.sqrt(1 - across @ across)])


def _around(axis: np.ndarray, peak, uniform: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Return directions (..., 3) about an axis with the angles of a phase function."""
    angle, turn = peak.sample(uniform.ravel()).reshape(uniform.shape)[..., None], 2 * np.pi * turn[..., None]
    first = np.cross(axis, [0.0, 1.0, 0.0])
    first /= np.linalg.norm(first)
    second = np.cross(axis, first)
    return np.cos(angle) * axis + np.sin(angle) * (np.cos(turn) * first + np.sin(turn) * second)


def radiances_towards(scene: Scene, *, depth_m: float, cosines: np.ndarray, seeds: int, count: int) -> np.ndarray:
    """Return the radiance seen from a depth at cosines with the upward vertical, (seeds, cosines)."""
    cosines = np.asarray(cosines, float)
    view = np.stack([np.sqrt(1 - cosines**2), np.zeros_like(cosines), cosines], axis=-1)
    directions = np.broadcast_to(np.repeat(view, count, axis=0), (seeds, count * len(cosines), 3))
    found = radiances(scene, depth_m=depth_m, directions=directions, seeds=seeds)
    return found.reshape(seeds, len(cosines), count).mean(axis=2)
