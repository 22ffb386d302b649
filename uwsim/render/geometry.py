"""Geometry buffers: what the ray through each pixel's centre meets. No light transport, no medium.

Works in compiled variants on all rays at once, and ray by ray in the scalar variant that needs no libLLVM.
"""

import numpy as np

from uwsim.camera import pinhole
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.render.build import body_number, build_bodies
from uwsim.render.film import View

_LANES = 4  # wavelengths that one Mitsuba ray carries


def geometry(scene, view: View, *, world_from_camera: np.ndarray) -> dict[str, np.ndarray]:
    """Return `range`, `z_depth` (H, W) [m], `normal` and `albedo` (H, W, 3), `instance` (H, W) uint32.

    Rays through pixel centres from `world_from_camera` (4, 4). Where no body is seen, distances are +inf and the
    rest 0. Normals point towards the camera, in world axes; albedo is the diffuse reflectance weighted by the
    response.
    """
    directions = pinhole.ray_directions(view.K, width_px=view.width_px, height_px=view.height_px)
    world = directions.reshape(-1, 3) @ world_from_camera[:3, :3].T
    loaded = build_bodies(scene)
    cast = _cast_scalar if _is_scalar() else _cast_compiled
    weights = view.response * np.gradient(WAVELENGTHS_NM)[:, None]
    distance, normal, instance, albedo = cast(loaded, world_from_camera[:3, 3], world, weights / weights.sum(axis=0))

    seen = np.isfinite(distance)
    facing = np.sign(-np.sum(normal * world, axis=-1, keepdims=True))
    shape = (view.height_px, view.width_px)
    range_m = np.where(seen, distance, np.inf).astype(np.float32).reshape(shape)
    return {
        "range": range_m,
        "z_depth": range_m * directions[..., 2].astype(np.float32),
        "normal": np.where(seen[:, None], normal * facing, 0).astype(np.float32).reshape(*shape, 3),
        "albedo": np.where(seen[:, None], albedo, 0).astype(np.float32).reshape(*shape, 3),
        "instance": np.where(seen, instance, 0).astype(np.uint32).reshape(shape),
    }


def _is_scalar() -> bool:
    import mitsuba as mi

    return mi.variant().startswith("scalar_")


def _cast_compiled(scene, origin: np.ndarray, directions: np.ndarray, weights: np.ndarray):
    import drjit as dr
    import mitsuba as mi

    rays = mi.Ray3f(mi.Point3f(*map(float, origin)), mi.Vector3f(directions.T.astype(np.float32)))
    si = scene.ray_intersect(rays)
    instance = mi.UInt32(0)
    for shape in scene.shapes():
        instance = dr.select(si.shape == mi.ShapePtr(shape), body_number(shape.id()), instance)
    # the albedo of a Lambertian body is pi times its BSDF, here seen and lit along the normal
    si.wi = mi.Vector3f(0, 0, 1)
    bsdf = si.bsdf()
    albedo = np.zeros((len(directions), weights.shape[1]))
    for start in range(0, len(WAVELENGTHS_NM), _LANES):
        carried = WAVELENGTHS_NM[start : start + _LANES]
        si.wavelengths = mi.Spectrum(*np.resize(carried, _LANES).tolist())
        dr.make_opaque(si.wavelengths)  # one kernel for all wavelengths
        value = bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(0, 0, 1), si.is_valid()) * dr.pi
        albedo += value.numpy().T[:, : len(carried)] @ weights[start : start + len(carried)]
    normal = si.n.numpy().T
    return si.t.numpy(), normal, instance.numpy(), albedo


def _cast_scalar(scene, origin: np.ndarray, directions: np.ndarray, weights: np.ndarray):
    import mitsuba as mi

    context, upright = mi.BSDFContext(), mi.ScalarVector3f(0, 0, 1)
    count = len(directions)
    distance, instance = np.full(count, np.inf), np.zeros(count, int)
    normal, albedo = np.zeros((count, 3)), np.zeros((count, weights.shape[1]))
    for index, direction in enumerate(directions):
        si = scene.ray_intersect(mi.Ray3f(mi.ScalarPoint3f(origin), mi.ScalarVector3f(direction)))
        if not si.is_valid():
            continue
        distance[index], normal[index] = si.t, np.array(si.n)
        instance[index] = body_number(si.shape.id())
        si.wi = upright
        bsdf = si.bsdf()
        for start in range(0, len(WAVELENGTHS_NM), _LANES):
            carried = WAVELENGTHS_NM[start : start + _LANES]
            si.wavelengths = mi.Spectrum(np.resize(carried, _LANES).tolist())
            value = np.array(bsdf.eval(context, si, upright)) * np.pi
            albedo[index] += value[: len(carried)] @ weights[start : start + len(carried)]
    return distance, normal, instance, albedo
