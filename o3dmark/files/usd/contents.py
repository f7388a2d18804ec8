"""What is in a USD layer beside positions and triangles, in the words of `asset.KINDS`; and the files that it names."""

import re
from typing import Any

from pxr import Sdf, Usd, UsdGeom

from o3dmark.files.asset import STAYS
from o3dmark.files.usd.scene import Mesh

PICTURE = re.compile(r"\.(png|jpe?g|exr|hdr|tiff?|tga|bmp|avif|webp|dds|ktx2?|tx)$", re.IGNORECASE)
_TYPES = {
    "Material": "materials",
    "Skeleton": "skins",
    "SkelAnimation": "animations",
    "BlendShape": "morph targets",
    "Camera": "cameras",
    "GeomSubset": "groups",
    "Points": "points",
    "BasisCurves": "lines",
    "NurbsCurves": "lines",
    "HermiteCurves": "lines",
}


def assets(layer: Any) -> list[str]:
    """The files that attributes of a layer name."""
    found: list[str] = []

    def visit(path: Any) -> None:
        spec = layer.GetAttributeAtPath(path) if path.IsPropertyPath() else None
        value = spec.default if spec else None
        values = value if isinstance(value, Sdf.AssetPathArray) else [value]
        found.extend(each.path for each in values if isinstance(each, Sdf.AssetPath) and each.path)

    layer.Traverse("/", visit)
    return found


def contents(layer: Any, found: list[Mesh], named: list[str]) -> set[str]:
    """The words for a layer in which these meshes were found, and these files named."""
    stage = Usd.Stage.Open(layer)
    words = {"polygons"} if any(mesh.polygons for mesh in found) else set()
    words |= {"names"} if found else set()
    words |= {"several meshes"} if len(found) > 1 else set()
    words |= (
        {"nodes"} if any(len(m.places) > 1 or (m.places and (m.places[0] != STAYS[0]).any()) for m in found) else set()
    )
    words |= {"textures"} if any(map(PICTURE.search, named)) else set()
    said = [layer.customLayerData, layer.documentation, layer.comment]
    said += [stage.HasAuthoredMetadata(name) for name in ("upAxis", "metersPerUnit")]
    words |= {"metadata"} if any(said) else set()
    for prim in stage.TraverseAll():
        kind = str(prim.GetTypeName())
        words |= {_TYPES[kind]} if kind in _TYPES else {"lights"} if kind.endswith("Light") else set()
        words |= {"variants"} if prim.HasVariantSets() else set()
        if prim.IsA(UsdGeom.Mesh):
            words |= _of_mesh(prim)
    words |= {"animations"} if layer.ListAllTimeSamples() else set()
    return words


def _of_mesh(prim: Any) -> set[str]:
    words = {"normals"} if UsdGeom.Mesh(prim).GetNormalsAttr().HasAuthoredValue() else set()
    coordinates = 0
    for primvar in UsdGeom.PrimvarsAPI(prim).GetPrimvarsWithAuthoredValues():
        name, kind = str(primvar.GetPrimvarName()), str(primvar.GetTypeName())
        if kind.startswith("texCoord") or name == "st":
            coordinates += 1
        elif name in ("displayColor", "displayOpacity"):
            constant = primvar.GetInterpolation() == UsdGeom.Tokens.constant
            words.add("materials" if constant else "vertex colours")
        elif name.startswith("skel:"):
            words.add("skins")
        else:
            words.add({"normals": "normals", "tangents": "tangents"}.get(name, f"property {name}"))
    words |= {"texture coordinates"} if coordinates else set()
    return words | ({"second texture coordinates"} if coordinates > 1 else set())
