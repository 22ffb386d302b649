"""Geometry buffers: what the ray through each pixel's centre meets. No light transport, no medium.

Works in compiled variants on all rays at once, and ray by ray in the scalar variant that needs no libLLVM.
"""

import numpy as np

from uwsim.camera.lens import pixel_centres
from uwsim.optics.spectrum import WAVELENGTHS_NM
from uwsim.render.build import body_number, build_bodies
from uwsim.render.film import View
from uwsim.render.smooth import Surfaces

_LANES = 4  # wavelengths that one Mitsuba ray carries
_MOST_POSES = 64  # of an exposure, that the mean of what is seen is over


def geometry(scene, view: View, *, world_from_camera: np.ndarray | None = None) -> dict[str, np.ndarray]:
    """Return `range`, `z_depth` (H, W) [m], `normal` and `albedo` (H, W, 3), `instance` (H, W) uint32.

    Rays through pixel centres from `world_from_camera` (4, 4), by default from where the camera is in the middle of
    each row's exposure. `range` is the path in the water: from the pinhole, or from the port's outer face; `z_depth`
    is that of the point seen in the camera frame. Where no body is seen, distances are +inf and the rest 0. Normals
    point towards the camera, in world axes; albedo is the diffuse reflectance weighted by the response.
    """
    return _cast(scene, view, build_bodies(scene), _lens_rays(view), world_from_camera)


def mean_surfaces(scene, view: View, world_from_camera: np.ndarray) -> Surfaces:
    """Return what the pixels see from poses (n, 4, 4) of a moving camera, as a mean over the poses; bodies are at rest.

    Of more than 64 poses, 64 that are spread evenly.
    """
    loaded, rays, count = build_bodies(scene), _lens_rays(view), len(world_from_camera)
    chosen = np.unique(np.linspace(0, count - 1, min(count, _MOST_POSES)).round().astype(int))
    albedo, normal = 0.0, 0.0
    for pose in world_from_camera[chosen]:
        seen = _cast(scene, view, loaded, rays, pose)
        albedo, normal = albedo + seen["albedo"].astype(float), normal + seen["normal"].astype(float)
    albedo, normal = ((total / len(chosen)).astype(np.float32) for total in (albedo, normal))
    return Surfaces(albedo=albedo, normal=normal)


def _lens_rays(view: View) -> tuple[np.ndarray, np.ndarray]:
    """Return the rays in the water of all pixel centres in the camera frame, (H, W, 3)."""
    return view.lens.rays(pixel_centres(width_px=view.width_px, height_px=view.height_px))


def _cast(scene, view: View, loaded, rays, world_from_camera: np.ndarray | None) -> dict[str, np.ndarray]:
    local_origins, local = rays
    origins, world = _in_world(scene, view, rays, world_from_camera)
    # a ray that the lens does not have is cast somewhere and forgotten
    has_ray = np.all(np.isfinite(world), axis=-1)
    origins, world = np.where(has_ray[:, None], origins, 0.0), np.where(has_ray[:, None], world, [0.0, 0.0, 1.0])
    cast = _cast_scalar if _is_scalar() else _cast_compiled
    weights = view.response * np.gradient(WAVELENGTHS_NM)[:, None]
    distance, normal, instance, albedo = cast(loaded, origins, world, weights / weights.sum(axis=0))

    seen = np.isfinite(distance) & has_ray
    facing = np.sign(-np.sum(normal * world, axis=-1, keepdims=True))
    shape = (view.height_px, view.width_px)
    range_m = np.where(seen, distance, np.inf).astype(np.float32).reshape(shape)
    return {
        "range": range_m,
        "z_depth": _z_depth(range_m, local_origins, local),
        "normal": np.where(seen[:, None], normal * facing, 0).astype(np.float32).reshape(*shape, 3),
        "albedo": np.where(seen[:, None], albedo, 0).astype(np.float32).reshape(*shape, 3),
        "instance": np.where(seen, instance, 0).astype(np.uint32).reshape(shape),
    }


def pixel_rays(scene, view: View) -> tuple[np.ndarray, np.ndarray]:
    """Return the rays in the water of all pixel centres in the world: origins [m] and unit directions, (H, W, 3).

    In the middle of each row's exposure; NaN where the lens or the port has no ray.
    """
    rays = _lens_rays(view)
    origins, directions = _in_world(scene, view, rays, None)
    return origins.reshape(rays[0].shape), directions.reshape(rays[1].shape)


def _in_world(scene, view: View, rays, world_from_camera) -> tuple[np.ndarray, np.ndarray]:
    """Return origins and directions (n, 3) in the world of rays (H, W, 3) in the camera frame."""
    origins, directions = rays
    if world_from_camera is None and view.shutter.readout_s > 0:
        poses = scene.rig.poses_at(view.shutter.row_middles_s())  # (H, 4, 4)
        origins = origins @ np.swapaxes(poses[:, :3, :3], -1, -2) + poses[:, None, :3, 3]
        return origins.reshape(-1, 3), (directions @ np.swapaxes(poses[:, :3, :3], -1, -2)).reshape(-1, 3)
    pose = scene.rig.world_from_rig if world_from_camera is None else world_from_camera
    world = directions.reshape(-1, 3) @ pose[:3, :3].T
    return origins.reshape(-1, 3) @ pose[:3, :3].T + pose[:3, 3], world


def _z_depth(range_m: np.ndarray, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
    seen = np.isfinite(range_m)
    depth = origins[..., 2].astype(np.float32) + range_m * directions[..., 2].astype(np.float32)
    return np.where(seen, depth, np.float32(np.inf))


def _is_scalar() -> bool:
    import mitsuba as mi

    return mi.variant().startswith("scalar_")


def _cast_compiled(scene, origins: np.ndarray, directions: np.ndarray, weights: np.ndarray):
    import drjit as dr
    import mitsuba as mi

    rays = mi.Ray3f(mi.Point3f(origins.T.astype(np.float32)), mi.Vector3f(directions.T.astype(np.float32)))
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


def _cast_scalar(scene, origins: np.ndarray, directions: np.ndarray, weights: np.ndarray):
    import mitsuba as mi

    context, upright = mi.BSDFContext(), mi.ScalarVector3f(0, 0, 1)
    count = len(directions)
    distance, instance = np.full(count, np.inf), np.zeros(count, int)
    normal, albedo = np.zeros((count, 3)), np.zeros((count, weights.shape[1]))
    for index, (origin, direction) in enumerate(zip(origins, directions, strict=True)):
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
