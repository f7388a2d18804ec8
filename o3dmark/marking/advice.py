"""What does work where a mark does not fit: other profiles are tried on the very mesh, and named when they hold."""

from dataclasses import replace
from typing import Any

from o3dmark.coding.keys import Key
from o3dmark.coding.payload import least_bits
from o3dmark.errors import MeshError, SpecError
from o3dmark.files import Asset, Part
from o3dmark.marking.embedding import mesh_of
from o3dmark.mesh import geometry
from o3dmark.mesh.surface import check_precision
from o3dmark.profiles import PROFILES
from o3dmark.watermark import Watermark

_SIZES = (4, 2, 1)  # message bytes to try when the message in hand fits no profile


def advice(asset: Asset, watermark: Watermark, message: str, key: Key) -> str:
    """A sentence that names a profile which holds ``message`` in the largest part, or how many bytes one does hold.

    Each is embedded and read back before it is named. Where none works, the sentence says what was tried.
    """
    usable = [part for part in asset.parts if not part.fixed and _precise(part)]
    if not usable:
        return ""
    mesh = mesh_of(max(usable, key=lambda part: len(part.triangles)))
    others = {name: mark for name, mark in PROFILES.items() if mark != watermark}
    for name, mark in others.items():
        if _holds(mesh, mark, message, key):
            return f"--profile {name} holds this message in this mesh"
    for size in _SIZES:
        text = "x" * size
        for name, mark in PROFILES.items():
            fewer = replace(mark, n_bits=min(mark.n_bits, least_bits(size)))
            if _holds(mesh, fewer, text, key):
                bits = "" if fewer == mark else f" --n-bits {fewer.n_bits}"
                return f"--profile {name}{bits} holds a message of {size} byte{'s' if size > 1 else ''} in this mesh"
    return f"none of the profiles {', '.join(PROFILES)} holds even one byte in this mesh"


def _precise(part: Part) -> bool:
    try:
        check_precision(part.steps, geometry.diagonal(part.vertices))
    except MeshError:
        return False
    return True


def _holds(mesh: Any, watermark: Watermark, message: str, key: Key) -> bool:
    try:
        if watermark.method.capacity(mesh) < watermark.n_bits:
            return False
        return watermark.extract(watermark.embed(mesh, message, key), key).message == message
    except (MeshError, SpecError):
        return False
