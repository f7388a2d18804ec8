"""What is looked at by default: the models, the bust in every other format, and the small glTF cases of the tests."""

import io
import json
import struct
import sys
import zipfile
from pathlib import Path

from models import BODY, MODELS, body

from o3dmark.files import FORMATS, read_mesh, write_mesh

GLTF = (".glb", ".gltf")
OPC = "http://schemas.openxmlformats.org/package/2006"
OPC_3MF = "http://schemas.microsoft.com/3dmanufacturing"
OPC_MODEL = "application/vnd.ms-package.3dmanufacturing-3dmodel+xml"


def samples(folder: Path) -> list[Path]:
    """All of them, written into a folder."""
    contents = {f"{name}.glb": make() for name, make in MODELS.items()} | {"bust.3mf": three_mf()}
    contents |= pair("pair", contents["plain.glb"])
    for name, content in contents.items():
        (folder / name).write_bytes(content)
    others = [folder / f"bust{suffix}" for suffix in FORMATS if suffix not in GLTF]
    for path in others:
        write_mesh(path, read_mesh(BODY))
    return [*(folder / name for name in contents if not name.endswith(".bin")), *others, *cases(folder)]


def cases(folder: Path) -> list[Path]:
    """The small glTF cases of the tests, each in a folder of its own with what lies beside it."""
    sys.path.append(str(Path(__file__).parents[2] / "tests"))
    from fixtures.gltf_files import CASES

    written = []
    for name, make in CASES.items():
        case, here = make(), folder / name
        here.mkdir()
        for each, content in case.files.items():
            (here / each).write_bytes(content)
        written.append((here / case.name).rename(here / f"case {name}{Path(case.name).suffix}"))
    return written


def pair(name: str, glb: bytes) -> dict[str, bytes]:
    """The .gltf and the .bin that hold what a GLB holds."""
    size = struct.unpack_from("<I", glb, 12)[0]
    document = json.loads(glb[20 : 20 + size])
    document["buffers"][0]["uri"] = f"{name}.bin"
    return {f"{name}.gltf": json.dumps(document).encode(), f"{name}.bin": glb[28 + size :]}


def three_mf() -> bytes:
    """The bust as a slicer would save it: one object, printed once."""
    vertices, triangles, _ = body()
    corners = "".join(f'<vertex x="{x:.6g}" y="{y:.6g}" z="{z:.6g}"/>' for x, y, z in 50 * vertices)
    faces = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in triangles)
    mesh = f"<mesh><vertices>{corners}</vertices><triangles>{faces}</triangles></mesh>"
    model = (
        f'<?xml version="1.0" encoding="UTF-8"?><model unit="millimeter" xmlns="{OPC_3MF}/core/2015/02"><resources>'
        f'<object id="1" type="model">{mesh}</object></resources><build><item objectid="1"/></build></model>'
    )
    kinds = f'<Types xmlns="{OPC}/content-types"><Default Extension="model" ContentType="{OPC_MODEL}"/></Types>'
    root = f'<Relationship Target="/3D/3dmodel.model" Id="root" Type="{OPC_3MF}/2013/01/3dmodel"/>'
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("[Content_Types].xml", kinds)
        archive.writestr("_rels/.rels", f'<Relationships xmlns="{OPC}/relationships">{root}</Relationships>')
        archive.writestr("3D/3dmodel.model", model)
    return file.getvalue()
