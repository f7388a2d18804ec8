"""Which patches of a received file a key finds, whatever else in it speaks: for those who want to see them."""

from dataclasses import dataclass
from typing import Any

from o3dmark.coding.detection import charge
from o3dmark.coding.keys import Key
from o3dmark.errors import MeshError, SpecError
from o3dmark.marking.views import views
from o3dmark.mesh.patch import Patch
from o3dmark.profiles import PROFILES
from o3dmark.watermark import Watermark


@dataclass(frozen=True)
class PatchesFound:
    """Patches in the file's unit and coordinates, the part that has them, and log10 of their p-value, all charged."""

    part: str = ""
    patches: tuple[Patch, ...] = ()
    log10_p: float = 0.0


def patches_found(received: Any, watermark: Watermark | None, key: Key) -> PatchesFound:
    """The patches of the first part of an `Asset`, mesh or point cloud that has any; also where the whole speaks too.

    ``watermark`` None: all profiles with patches are tried. Errors: SpecError for a method without patches; MeshError
    when nothing can be read at all.
    """
    marks = list(PROFILES.values()) if watermark is None else [watermark]
    readers = [(mark.method.local, mark) for mark in marks]
    looks = [(view, local, mark) for local, mark in readers if local for view in views(received, mark.method)]
    if not looks:
        names = ", ".join(name for name, profile in PROFILES.items() if profile.method.local)
        raise SpecError(f"this method reads the surface as a whole, and has no patches; profiles that have: {names}")
    error, read = MeshError("there is nothing to read"), False
    for view, local, mark in looks:
        try:
            extraction = local.extract(view.shape, mark.n_bits, key)
        except MeshError as refusal:
            error = refusal
            continue
        read = True
        if extraction.patches:
            log10_p = charge(extraction.log10_p or 0.0, len(looks))
            return PatchesFound(view.part, view.patches(extraction), log10_p)
    if not read:
        raise error
    return PatchesFound()
