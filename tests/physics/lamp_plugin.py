"""Lamps of scenes as Mitsuba emitters in their own frame: beam along +z, LEDs about the origin."""

import numpy as np

from tests.physics import scenes
from uwsim.scene.lamp import Lamp

N_WATER = 1.34
WIDTH_NM = 300.0
"""Of the working range: an equal-energy lamp has 1/300 of its intensity per nm."""


def lamp(**changes) -> Lamp:
    """Return a lamp of 1 W/sr on the axis, equal energy; `None` takes a value away."""
    values = {
        "position_m": [0, 0, 0],
        "look_at_m": [0, 0, 1],
        "radiant_intensity_w_per_sr": 1.0,
        "half_angle_deg": 50.0,
        "spectrum": "E",
    } | changes
    return Lamp.model_validate({key: value for key, value in values.items() if value is not None})


def emitter(made: Lamp, *, poses=None, n_water: float = N_WATER):
    """Return the emitter with world = its own frame, or at `poses` (n, 4, 4), world_from_lamp."""
    import mitsuba as mi

    from uwsim.render.build import _lamp

    poses = np.eye(4)[None] if poses is None else np.asarray(poses)
    return mi.load_dict(_lamp(mi, made, poses @ np.linalg.inv(made.rig_from_lamp), n_water=n_water))


def at(points, *, time: float = 0.0):
    """Return interactions at points (n, 3), at 550 nm."""
    import drjit as dr
    import mitsuba as mi

    found = dr.zeros(mi.MediumInteraction3f)
    found.p = mi.Point3f(np.asarray(points, np.float32).reshape(-1, 3).T)
    found.time, found.wavelengths = mi.Float(time), mi.Spectrum(550.0)
    return found


def irradiance(plugin, points, *, state=(0.5, 0.5), time: float = 0.0):
    """Return the irradiance over all wavelengths on planes normal to the rays, (n,) [W/m^2], and the samples."""
    import mitsuba as mi

    state = mi.Point2f(*[mi.Float(np.asarray(part, np.float32)) for part in state])
    ds, value = plugin.sample_direction(at(points, time=time), state)
    return WIDTH_NM * value.numpy()[0].astype(float), ds


def seen(plugin, origin, direction):
    """Return the distance (n,) to dies that rays meet, inf for none, and their radiance [W m^-2 sr^-1]."""
    import mitsuba as mi

    o, d = (np.asarray(v, np.float32).T for v in np.broadcast_arrays(origin, direction))
    distance, radiance = plugin.seen(mi.Ray3f(mi.Point3f(o), mi.Vector3f(d), 0.0, mi.Spectrum(550.0)))
    distance, radiance = distance.numpy().astype(float), radiance.numpy()[0].astype(float)
    return (np.broadcast_to(part, len(o[0])) for part in (distance, WIDTH_NM * radiance))


def wall_lit_by(made: Lamp, *, distance_m: float):
    """Return a scene: grey wall (reflectance 0.5) square to a narrow camera, lit by this lamp, near the origin.

    Mitsuba starts rays at a distance from surfaces of 1e-4 of the largest coordinate: 9 mm at 100 m.
    """
    scene = scenes.wall(distance_m=distance_m)
    rig = scene.rig.model_copy(update={"lamps": (made,), "position_m": (0, 0, -1.0), "look_at_m": (0, 1.0, -1.0)})
    body = scene.bodies[0].model_copy(update={"position_m": (0, distance_m, -1.0), "towards_m": (0, 0, -1.0)})
    return scene.model_copy(update={"rig": rig, "bodies": (body,)})
