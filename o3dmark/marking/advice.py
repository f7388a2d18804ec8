"""What does work where a mark does not fit: other profiles are tried on the very mesh, and named when they hold."""

from dataclasses import replace

import numpy as np

from o3dmark.arrays import Floats
from o3dmark.coding.keys import Key
from o3dmark.coding.payload import least_bits
from o3dmark.errors import MeshError, SpecError
from o3dmark.files import Asset, Part
from o3dmark.marking.embedding import mesh_of
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import MeshArrays, Surface, check_precision
from o3dmark.profiles import PROFILES, separate
from o3dmark.watermark import Watermark

_SIZES = (4, 2, 1)  # message bytes to try when the message in hand fits no profile


def advice(asset: Asset, watermark: Watermark, message: str, key: Key) -> str:
    """A sentence that names a profile which holds ``message`` in the largest part, or how many bytes one does hold.

    Each is embedded and read back before it is named. Where none works, the sentence says what was tried.
    """
    usable = [part for part in asset.parts if not part.fixed and _is_usable(part)]
    if not usable:
        return ""
    part = max(usable, key=lambda part: len(part.triangles))
    profiles = {name: PROFILES[name] for name in separate()}
    others = {name: mark for name, mark in profiles.items() if not _holds_no_more(mark, watermark)}
    for name, mark in others.items():
        if _holds(part, mark, message, key):
            return f"--profile {name} holds this message in this mesh"
    for size in _SIZES:
        text = "x" * size
        for name, mark in profiles.items():
            fewer = replace(mark, n_bits=min(mark.n_bits, least_bits(size)))
            if _holds(part, fewer, text, key):
                bits = "" if fewer == mark else f" --n-bits {fewer.n_bits}"
                return f"--profile {name}{bits} holds a message of {size} byte{'s' if size > 1 else ''} in this mesh"
    return f"none of the profiles {', '.join(profiles)} holds even one byte in this mesh"


def _holds_no_more(other: Watermark, watermark: Watermark) -> bool:
    """Whether another watermark is this one, or has it as a layer."""
    return any(replace(other, method=each) == watermark for each in (other.method, *other.method.layers.values()))


def _is_usable(part: Part) -> bool:
    """Whether a part is a surface whose numbers are fine enough, so that another profile may help."""
    try:
        Surface.from_arrays(part.vertices, part.triangles)
        check_precision(part.steps, geometry.diagonal(part.vertices))
    except MeshError:
        return False
    return True


def _holds(part: Part, watermark: Watermark, message: str, key: Key) -> bool:
    """Whether a part tells a message, with its positions as the file can hold them."""
    mesh = mesh_of(part)
    try:
        if watermark.method.capacity(mesh) < watermark.n_bits:
            return False
        marked = np.asarray(watermark.embed(mesh, message, key).vertices)
        written = MeshArrays(_rounded(marked, part.steps), part.triangles)
        return watermark.extract(written, key).message == message
    except (MeshError, SpecError):
        return False


def _rounded(vertices: Floats, steps: Floats) -> Floats:
    """Vertices (n, 3) on the grid of steps, where it is coarse enough to matter."""
    coarse = np.broadcast_to(steps > 1e-9 * np.abs(vertices).max(), vertices.shape)
    grid = np.where(coarse, steps, 1.0)
    return np.where(coarse, np.rint(vertices / grid) * grid, vertices)
