"""What the page's script is given: meshes about one centre in one unit, and how they are looked at.

Positions are float32 about the centre of the first mesh's bounding box, in units of its diagonal. A mesh that has the
first one's triangles is kept as its displacement from that, in float32 too: seven digits of the displacement itself.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from o3dmark.errors import SpecError
from o3dmark.view import shading
from o3dmark.view.camera import FIELD_OF_VIEW, Camera
from o3dmark.view.colours import colours
from o3dmark.view.page.buffers import Buffers
from o3dmark.view.page.drawn import Drawn, Shown
from o3dmark.view.render import GAMMA, MATERIAL
from o3dmark.view.side import best_side
from o3dmark.view.worn import vertex_colours

LOOKS = {  # and the words for them
    "worn": "Own colours",
    "clay": "Clay",
    "gloss": "Glossy",
    "zebra": "Reflection lines",
    "displacement": "Displacement",
    "saliency": "Saliency",
}
RAMPS = {"displacement": "plasma", "saliency": "viridis"}  # quantities and their colormaps
FACTORS = 0, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000  # that the slider offers


def content(
    meshes: Sequence[Shown], look: str | None, camera: Camera | None, exaggeration: float | None
) -> dict[str, Any]:
    """Everything that the script needs, ready for JSON; arguments and errors as of `page`."""
    if not meshes:
        raise ValueError("a page needs a mesh to show")
    first = Drawn(meshes[0])
    drawn = [first, *(Drawn(each, first) for each in meshes[1:])]
    looks = list(_looks(drawn))
    if look is not None and look not in looks:
        raise SpecError(f"no mesh of the page can be shown as {look!r}; there is {', '.join(looks)}")
    camera = _camera(drawn) if camera is None else camera
    buffers = Buffers()
    return {
        "meshes": [each.told(buffers) for each in drawn],
        "looks": [[name, LOOKS[name]] for name in looks],
        "look": look or looks[0],
        "ramps": {name: buffers.array(_ramp(colormap), "uint8") for name, colormap in RAMPS.items()},
        "camera": {"azimuth": camera.azimuth, "elevation": camera.elevation, "zoom": camera.zoom},
        "world": camera.world.ravel().tolist(),
        "fieldOfView": FIELD_OF_VIEW,
        "factors": _factors(exaggeration) if any(each.moved for each in drawn) else [],
        "factor": 1.0 if exaggeration is None else exaggeration,
        "rounding": max(each.rounding for each in drawn),
        "studio": _studio(),
        "buffers": buffers.texts,
    }


def _looks(drawn: Sequence[Drawn]) -> Iterator[str]:
    """The looks of which some mesh has something to show."""
    for name in LOOKS:
        if name == "worn":
            there = any(each.texture or vertex_colours(each.shown.mesh) is not None for each in drawn)
        else:
            there = name not in RAMPS or any(name in each.quantities for each in drawn)
        if there:
            yield name


def _camera(drawn: Sequence[Drawn]) -> Camera:
    """The side of the first mesh that shows most, of the first displacement from it if there is one."""
    moved = next((each.moved for each in drawn if each.moved), None)
    return best_side(drawn[0].shown.mesh, None if moved is None else moved.lengths)


def _factors(own: float | None) -> list[float]:
    return sorted({float(factor) for factor in FACTORS} | ({own} if own is not None else set()))


def _ramp(colormap: str) -> Any:
    """Its 256 colours (256, 4) as bytes."""
    rgb = colours(np.linspace(0.0, 1.0, 256), (0.0, 1.0), colormap)
    return np.round(255.0 * np.column_stack([rgb, np.ones(256)]))


def _studio() -> dict[str, Any]:
    """The light of `shading`, for the script's shader: what it calls a thing, and the thing."""
    return {
        "material": MATERIAL.tolist(),
        "gamma": GAMMA,
        "key": shading.KEY,
        "keyColour": shading.KEY_COLOUR.tolist(),
        "fill": shading.FILL,
        "fillColour": shading.FILL_COLOUR.tolist(),
        "skyColour": shading.SKY_COLOUR.tolist(),
        "groundColour": shading.GROUND_COLOUR.tolist(),
        "clay": [shading.GLOSS, shading.GLOSS_EXPONENT],
        "varnish": [shading.VARNISH, shading.VARNISH_EXPONENT],
        "stripes": shading.STRIPES,
        "edge": shading.EDGE,
        "stripeLight": [shading.DARK, shading.LIGHT],
    }
