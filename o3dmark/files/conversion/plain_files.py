"""Formats that hold little but shape, written from the parts of an asset: STL, OFF and 3MF."""

import io
import zipfile
from xml.sax.saxutils import quoteattr

import numpy as np

from o3dmark.arrays import Floats, Ints
from o3dmark.errors import MeshError
from o3dmark.files.asset import STAYS, Asset, Part
from o3dmark.mesh import geometry

_CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
_PACKAGE = "http://schemas.openxmlformats.org/package/2006"
_RELATIONSHIPS = (
    f'<?xml version="1.0" encoding="UTF-8"?>\n<Relationships xmlns="{_PACKAGE}/relationships"><Relationship Id="model"'
    ' Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel" Target="/3D/3dmodel.model"/></Relationships>'
)
_TYPES = (
    f'<?xml version="1.0" encoding="UTF-8"?>\n<Types xmlns="{_PACKAGE}/content-types"><Default Extension="rels"'
    f' ContentType="application/vnd.openxmlformats-package.relationships+xml"/><Default Extension="model"'
    ' ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>'
)


def stl(asset: Asset) -> bytes:
    """A binary STL in float32. Errors: MeshError for positions beyond its range."""
    vertices, triangles = asset.placed()
    rows = np.zeros(len(triangles), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    with np.errstate(over="ignore"):
        rows["corners"] = vertices[triangles]
    if not np.isfinite(rows["corners"]).all():
        raise MeshError(f"{asset.name} has positions that STL cannot hold: they are not finite, or beyond float32")
    rows["normal"] = geometry.unit(geometry.area_vectors(vertices, triangles))
    return bytes(80) + len(rows).to_bytes(4, "little") + rows.tobytes()


def off(asset: Asset) -> bytes:
    """An OFF file with every digit, coincident vertices as one."""
    vertices, triangles = _welded(*asset.placed())
    counts = f"OFF\n{len(vertices)} {len(triangles)} 0\n"
    return (counts + _lines("%r %r %r\n", vertices) + _lines("3 %d %d %d\n", triangles)).encode()


def threemf(asset: Asset) -> bytes:
    """A 3MF: an object for each part, an item of the build for each place; coincident vertices as one.

    Triangles with a repeated corner, which 3MF forbids, are left out.
    """
    objects = [_object(number, part) for number, part in enumerate(asset.parts, start=1)]
    items = [
        f'<item objectid="{number}"{_transform(place)}/>\n'
        for number, part in enumerate(asset.parts, start=1)
        for place in part.placements
    ]
    model = (
        f'<?xml version="1.0" encoding="UTF-8"?>\n<model unit="millimeter" xml:lang="en-US" xmlns="{_CORE}">\n'
        f"<resources>\n{''.join(objects)}</resources>\n<build>\n{''.join(items)}</build>\n</model>\n"
    )
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in (
            ("[Content_Types].xml", _TYPES),
            ("_rels/.rels", _RELATIONSHIPS),
            ("3D/3dmodel.model", model),
        ):
            archive.writestr(zipfile.ZipInfo(name), text, zipfile.ZIP_DEFLATED)
    return out.getvalue()


def _object(number: int, part: Part) -> str:
    vertices, triangles = _welded(part.vertices, part.triangles)
    triangles = triangles[(triangles != np.roll(triangles, 1, axis=1)).all(axis=1)]
    # Characters that XML cannot hold would make the whole file unreadable.
    name = quoteattr("".join(letter for letter in part.name if letter.isprintable()))
    return (
        f'<object id="{number}" type="model" name={name}>\n<mesh>\n<vertices>\n'
        + _lines('<vertex x="%r" y="%r" z="%r"/>\n', vertices)
        + "</vertices>\n<triangles>\n"
        + _lines('<triangle v1="%d" v2="%d" v3="%d"/>\n', triangles)
        + "</triangles>\n</mesh>\n</object>\n"
    )


def _transform(place: Floats) -> str:
    numbers = place[:3].T.ravel().tolist()  # as 3MF multiplies: rows from the left
    return "" if (place == STAYS[0]).all() else f' transform="{" ".join(map(repr, numbers))}"'


def _welded(vertices: Floats, triangles: Ints) -> tuple[Floats, Ints]:
    kept, position = geometry.weld(vertices)
    return vertices[kept], position[triangles]


def _lines(form: str, rows: Floats | Ints) -> str:
    return form * len(rows) % tuple(rows.ravel().tolist())
