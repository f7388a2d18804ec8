"""Meshes to be turned in a browser: one HTML file that loads nothing, with three.js inside.

content     meshes -> what the page's script is given; drawn: of each mesh
corners     triangles as a graphics card wants them
buffers     arrays as text
page.html, page.css, *.js    the page; three.min.js is three.js, made by scripts/bundle_three
"""

import base64
import json
from collections.abc import Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template

from o3dmark.files import replacing
from o3dmark.view.camera import Camera
from o3dmark.view.page.content import content
from o3dmark.view.page.drawn import Shown

SCRIPTS = "buffers", "studio", "shape", "stage", "main"  # ours; each imports the others as o3dmark/NAME


def page(
    meshes: Sequence[Shown],
    *,
    title: str = "o3dmark",
    look: str | None = None,
    camera: Camera | None = None,
    exaggeration: float | None = None,
) -> str:
    """The HTML of a page that shows meshes and point clouds side by side, under one camera.

    look: how they are shown at first, a name of `content.LOOKS`; by default in their own colours, if any has some, else
    as clay. camera: by default on the side of the first mesh that shows most, of the displacement if there is one.
    exaggeration: how many times as large as it is a displacement is drawn at first, by default once.
    Errors: MeshError when a mesh cannot be drawn; SpecError for a look that no mesh has.
    """
    scene = content(meshes, look, camera, exaggeration)
    return Template(_text("page.html")).substitute(
        title=escape(title),
        style=_text("page.css"),
        licence=_text("three.LICENSE"),
        modules=json.dumps({"imports": _modules()}),
        scene=json.dumps(scene).replace("<", "\\u003c"),  # a name may hold </script>
    )


def write_page(
    path: str | Path,
    meshes: Sequence[Shown],
    *,
    title: str = "o3dmark",
    look: str | None = None,
    camera: Camera | None = None,
    exaggeration: float | None = None,
) -> None:
    """Write a `page`, with its options and errors; the file is there complete or not at all."""
    text = page(meshes, title=title, look=look, camera=camera, exaggeration=exaggeration)
    with replacing(path) as draft:
        draft.write_text(text, encoding="utf-8")


def _modules() -> dict[str, str]:
    """Where a browser finds each module: in the address itself, so that it asks nobody."""
    named = {"three": "three.min.js"} | {f"o3dmark/{name}": f"{name}.js" for name in SCRIPTS}
    return {
        name: f"data:text/javascript;base64,{base64.b64encode(_text(file).encode()).decode()}"
        for name, file in named.items()
    }


def _text(name: str) -> str:
    return (files(__package__) / name).read_text(encoding="utf-8")


__all__ = ["Shown", "page", "write_page"]
