"""The meshes of a composed USD stage, each with its source: the attribute of a layer that its points come from."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
from pxr import Usd, UsdGeom, Vt

from o3dmark.arrays import Floats, Ints
from o3dmark.errors import MeshError
from o3dmark.files.usd.layers import Vectors

_MOST_PLACES = 100_000
_ANOTHER_TYPE = "its positions are not of type point3f[], which USD asks for; export it again"
_CHANGE = "its positions change over time, and only still ones can be marked; export the scene without animation"

Key: TypeAlias = tuple[str, str]
"""The identifier of a layer, and the path of an attribute in it."""


@dataclass
class Mesh:
    """A mesh by the attribute of its points; ``own``: that is in the root layer, where it can change.

    normals: the path of their attribute, also in the root layer, what they are (k, 3), and which of them stands at each
    corner of the triangles (m, 3). extent: its path and value (2, 3). places: (4, 4) each, of the points in the world.
    """

    name: str
    path: str
    own: bool
    points: Vectors
    triangles: Ints
    fixed: str
    normals: tuple[str, Vectors, Ints] | None = None
    extent: tuple[str, Vectors] | None = None
    polygons: bool = False
    places: list[Floats] = field(default_factory=list)


def meshes(name: str, layer: Any) -> list[Mesh]:
    """All meshes that the stage of a layer draws. Errors: MeshError for one whose faces name points that are not there,
    or for instances without measure."""
    stage = Usd.Stage.Open(layer)
    time = Usd.TimeCode.EarliestTime()
    cache = UsdGeom.XformCache(time)
    found: dict[Key, Mesh] = {}
    instancers = _instancers(name, stage, cache, time)
    count = 0
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()):
        if not prim.IsA(UsdGeom.Mesh):
            continue
        points = UsdGeom.Mesh(prim).GetPointsAttr()
        stack = points.GetPropertyStack(Usd.TimeCode.Default())
        if not stack or points.Get(time) is None:
            continue
        source = next((spec for spec in stack if spec.HasInfo("default")), stack[0])
        key = source.layer.identifier, str(source.path)
        if key not in found:
            found[key] = _mesh(name, prim, source, source.layer == layer, time)
        places = list(_places(prim, cache, instancers))
        found[key].places += places
        count += len(places)
        if count > _MOST_PLACES:
            raise MeshError(f"{name} draws its meshes more than {_MOST_PLACES} times")
    return list(found.values())


def _mesh(name: str, prim: Any, source: Any, own: bool, time: Any) -> Mesh:
    shape = UsdGeom.Mesh(prim)
    counts, indices = (
        _numbers(name, attribute.Get(time), np.int64)
        for attribute in (shape.GetFaceVertexCountsAttr(), shape.GetFaceVertexIndicesAttr())
    )
    points = _numbers(name, shape.GetPointsAttr().Get(time), np.float32).reshape(-1, 3)
    label = str(prim.GetPath())
    if (counts < 0).any() or counts.sum() != len(indices):
        raise MeshError(f"{name}: the faces of {label} have other corners than their counts say")
    if len(indices) and (indices.min() < 0 or indices.max() >= len(points)):
        raise MeshError(f"{name}: a face of {label} names a point beyond its {len(points)}")
    corners, faces = _fans(counts)
    if shape.GetOrientationAttr().Get(time) == UsdGeom.Tokens.leftHanded:
        corners = corners[:, ::-1]
    moving = (shape.GetPointsAttr(), shape.GetFaceVertexIndicesAttr(), shape.GetFaceVertexCountsAttr())
    if any(attribute.GetNumTimeSamples() or attribute.ValueMightBeTimeVarying() for attribute in moving):
        fixed = _CHANGE
    elif not own:
        fixed = f"its positions are in another layer, {source.layer.GetDisplayName()}; mark that file"
    else:
        fixed = "" if isinstance(source.default, Vt.Vec3fArray) else _ANOTHER_TYPE
    result = Mesh(label, str(source.path), own, points, indices[corners], fixed, polygons=bool((counts > 3).any()))
    if not fixed:
        result.normals = _normals(prim, source.layer, indices, corners, faces, len(points))
        result.extent = _own(shape.GetExtentAttr(), source.layer)
    return result


def _numbers(name: str, value: Any, dtype: type[np.generic]) -> Any:
    """An array of a scene as one of numpy; none where there is no value. Errors: MeshError for other things."""
    try:
        with np.errstate(over="ignore"):  # what is larger than a number can be is infinite
            return np.array([] if value is None else value, dtype)
    except (TypeError, ValueError):
        raise MeshError(f"{name} is damaged: a mesh has {type(value).__name__} where numbers should be") from None


def _fans(counts: Ints) -> tuple[Ints, Ints]:
    """Polygons as triangles about their first corners: which of all corners each has (m, 3), and of which face."""
    first, triangles = np.cumsum(counts) - counts, np.maximum(counts - 2, 0)
    faces = np.repeat(np.arange(len(counts)), triangles)
    step = np.arange(len(faces)) - np.repeat(np.cumsum(triangles) - triangles, triangles)
    return np.column_stack([first[faces], first[faces] + step + 1, first[faces] + step + 2]), faces


def _own(attribute: Any, layer: Any) -> tuple[str, Vectors] | None:
    """The path and the value of an attribute that is an array of three floats, and stands still in a layer."""
    for spec in attribute.GetPropertyStack(Usd.TimeCode.Default()) if attribute else ():
        value = spec.default
        if spec.layer != layer or attribute.GetNumTimeSamples() or not isinstance(value, Vt.Vec3fArray):
            return None
        return str(spec.path), np.array(value, np.float32).reshape(-1, 3)
    return None


def _normals(
    prim: Any, layer: Any, indices: Ints, corners: Ints, faces: Ints, n_points: int
) -> tuple[str, Vectors, Ints] | None:
    """Normals of the root layer, if any: as a primvar, which comes first, or as the attribute of that name."""
    primvar = UsdGeom.PrimvarsAPI(prim).GetPrimvar("normals")
    attribute, chosen = UsdGeom.Mesh(prim).GetNormalsAttr(), np.empty(0, np.int64)
    interpolation = UsdGeom.Mesh(prim).GetNormalsInterpolation()
    if primvar and primvar.HasAuthoredValue():
        attribute, interpolation = primvar.GetAttr(), primvar.GetInterpolation()
        if primvar.IsIndexed():
            if primvar.GetIndicesAttr().GetNumTimeSamples():
                return None
            chosen = np.array(primvar.GetIndices(), np.int64)
    own = _own(attribute, layer)
    if own is None:
        return None
    place, size = {
        UsdGeom.Tokens.faceVarying: (corners, len(indices)),
        UsdGeom.Tokens.uniform: (np.repeat(faces[:, None], 3, axis=1), int(faces.max(initial=-1)) + 1),
    }.get(interpolation, (indices[corners], n_points))
    if interpolation == UsdGeom.Tokens.constant:
        return None
    used = chosen[place] if len(chosen) >= size and len(chosen) else place if not len(chosen) else None
    if used is None or used.min(initial=0) < 0 or used.max(initial=-1) >= len(own[1]):
        return None
    return own[0], own[1], used


def _places(prim: Any, cache: Any, instancers: list[tuple[Any, Floats, Floats]]) -> Iterator[Floats]:
    """Where a mesh stands (4, 4): in its place, or wherever an instancer repeats what it is in."""
    world = np.array(cache.GetLocalToWorldTransform(prim)).T
    path, repeated = prim.GetPath(), False
    for prototype, back, transforms in instancers:
        if path.HasPrefix(prototype):
            repeated = True
            yield from transforms @ (back @ world)
    if not repeated:
        yield world


def _instancers(name: str, stage: Any, cache: Any, time: Any) -> list[tuple[Any, Floats, Floats]]:
    """For each prototype of each instancer: its path, what takes the world to its frame, and where it is repeated."""
    found, count = [], 0
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()):
        if not prim.IsA(UsdGeom.PointInstancer):
            continue
        instancer = UsdGeom.PointInstancer(prim)
        which = _numbers(name, instancer.GetProtoIndicesAttr().Get(time), np.int64)
        count += len(which)
        if count > _MOST_PLACES:
            raise MeshError(f"{name} draws more than {_MOST_PLACES} instances")
        transforms = instancer.ComputeInstanceTransformsAtTime(
            time, time, UsdGeom.PointInstancer.ExcludeProtoXform, UsdGeom.PointInstancer.IgnoreMask
        )
        outer = np.array(cache.GetLocalToWorldTransform(prim)).T
        every = np.array([np.array(transform).T for transform in transforms or []]).reshape(-1, 4, 4)
        for number, prototype in enumerate(instancer.GetPrototypesRel().GetForwardedTargets()):
            root = stage.GetPrimAtPath(prototype)
            if root and len(every) == len(which):
                parent = np.array(cache.GetParentToWorldTransform(root)).T
                found.append((prototype, _inverse(parent), outer @ every[which == number]))
    return found


def _inverse(matrix: Floats) -> Floats:
    """The inverse of a transform (4, 4); of one that flattens, what comes nearest."""
    return np.asarray(np.linalg.inv(matrix) if np.linalg.det(matrix) else np.linalg.pinv(matrix), np.float64)
