"""The command `view`: meshes in a window, as a picture, or as a page for a browser."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from o3dmark.cli._arguments import Json, Overwrite
from o3dmark.cli._talk import print_result, say
from o3dmark.cli.owner import Method, NBits, Profile, asked
from o3dmark.errors import MeshError, SpecError

if TYPE_CHECKING:
    from o3dmark.files import Asset
    from o3dmark.marking import PatchesFound
    from o3dmark.view import Camera, Panel
    from o3dmark.watermark import Watermark

LOOKS = {"saliency": "saliency", "distance": "displacement"}  # of a page, by what --scalars says


def view(
    meshes: Annotated[list[Path], typer.Argument(metavar="MESH...", help="One or more meshes or point clouds.")],
    scalars: Annotated[str | None, typer.Option(help="saliency, or distance from the first mesh.")] = None,
    png: Annotated[Path | None, typer.Option(metavar="FILE", help="Write a picture; open no window.")] = None,
    html: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write a page to turn them in a browser; it loads nothing.")
    ] = None,
    camera: Annotated[
        str | None,
        typer.Option(
            metavar="SIDE", help="front, left, ..., or AZIMUTH,ELEVATION; then ,z where z is up. Else what shows most."
        ),
    ] = None,
    exaggerate: Annotated[
        float | None,
        typer.Option(
            metavar="N", help="Draw how meshes differ from the first, of the same triangles, N times as large."
        ),
    ] = None,
    zebra: Annotated[bool, typer.Option("--zebra", help="As mirrors under light tubes; not in a window.")] = False,
    key: Annotated[
        Path | None, typer.Option(metavar="FILE", help="With the patches that a key file finds; in a picture only.")
    ] = None,
    method: Method = None,
    profile: Profile = None,
    n_bits: NBits = None,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Look at meshes side by side, in a window or, without a display, as a picture or in a browser."""
    from o3dmark.files import check_free, open_asset, read_shape, whole_mesh
    from o3dmark.view import Camera, save_png, sheet, show

    mark = asked(method, profile, n_bits)
    _check(scalars, png, html, camera, exaggerate, zebra, key, mark)
    given = None if camera is None else Camera.parse(camera)
    for output in filter(None, (png, html)):
        check_free(output, *meshes, *filter(None, (key,)), overwrite=overwrite)
    assets = [] if key is None else [open_asset(path) for path in meshes]
    shapes = [whole_mesh(asset) for asset in assets] if assets else [read_shape(path) for path in meshes]
    names = [path.name for path in meshes]
    seen = scalars == "saliency" or png is not None or html is None  # a page finds distances by itself
    values = _scalars(scalars if seen else None, shapes)
    drawn = shapes if exaggerate is None else _exaggerated(shapes, exaggerate)
    found = None if key is None else _found(key, mark, assets)
    if html is not None:
        _write_page(html, names, shapes, values, scalars, given, exaggerate, zebra)
    if png is not None:
        panels = _panels(names, drawn, shapes, values, scalars, zebra, exaggerate)
        panels = panels if found is None else _with_patches(panels, found, given)
        save_png(png, sheet(panels, columns=min(len(panels), 3), camera=given or _side(shapes, values)))
    if png is None and html is None:
        show(drawn, values)
    told = None if found is None else [[patch.to_dict() for patch in each.patches] for each in found]
    outputs = [None if path is None else str(path) for path in (png, html)]
    about = {"html": outputs[1], "meshes": [str(path) for path in meshes], "patches": told}
    print_result({"output": outputs[0] or outputs[1]} | about, json)


def _check(
    scalars: str | None,
    png: Path | None,
    html: Path | None,
    camera: str | None,
    exaggerate: float | None,
    zebra: bool,
    key: Path | None,
    mark: "Watermark | None",
) -> None:
    """Errors: SpecError for options that do not go together."""
    if scalars is not None and scalars not in LOOKS:
        raise SpecError(f"--scalars is {' or '.join(LOOKS)}, not {scalars!r}")
    if zebra and scalars is not None:
        raise SpecError("--zebra shows no scalars: give one of the two")
    if (zebra or camera is not None) and png is None and html is None:
        raise SpecError("--zebra and --camera are not for the window: give --png FILE or --html FILE")
    if exaggerate is not None and not math.isfinite(exaggerate):
        raise SpecError(f"--exaggerate is a number, like 50, not {exaggerate}")
    if key is not None and (png is None or html is not None or scalars is not None or zebra or exaggerate is not None):
        raise SpecError("--key is for pictures, with neither scalars nor stripes nor exaggeration: give --png FILE")
    if key is None and mark is not None:
        raise SpecError("--method, --profile and --n-bits say what --key is to find: give --key FILE")


def _write_page(
    html: Path,
    names: Sequence[str],
    shapes: "Sequence[Any]",
    values: "Sequence[Any]",
    scalars: str | None,
    camera: "Camera | None",
    exaggerate: float | None,
    zebra: bool,
) -> None:
    """The page, with saliency where there is some."""
    from o3dmark.view import Shown, write_page

    saliency = values if scalars == "saliency" else [_saliency(*each) for each in zip(names, shapes, strict=True)]
    shown = [Shown(*each) for each in zip(names, shapes, saliency, strict=True)]
    look = "zebra" if zebra else None if scalars is None else LOOKS[scalars]
    write_page(html, shown, title=", ".join(names), look=look, camera=camera, exaggeration=exaggerate)


def _saliency(name: str, shape: Any) -> Any:
    """The saliency of a shape, or None and a word on stderr."""
    from o3dmark.mesh.saliency import Saliency

    try:
        return Saliency()(shape)
    except MeshError as error:
        say(f"{name} without saliency: {error}")
        return None


def _panels(
    names: Sequence[str],
    drawn: "Sequence[Any]",
    shapes: "Sequence[Any]",
    values: "Sequence[Any]",
    scalars: str | None,
    zebra: bool,
    exaggerate: float | None,
) -> "list[Panel]":
    """A panel for each mesh, in its own colours unless scalars or stripes are to be shown."""
    from o3dmark.view import SALIENCY, Panel, distance_from

    bar = SALIENCY if scalars == "saliency" else distance_from(names[0])
    return [
        Panel(
            name,
            mesh,
            "" if mesh is shape else f"its displacement drawn {exaggerate:g} times as large as it is",
            value,
            bar,
            frame=None if mesh is shape else shapes[0],
            look="zebra" if zebra else "clay" if value is not None else "worn",
        )
        for name, mesh, shape, value in zip(names, drawn, shapes, values, strict=True)
    ]


def _side(shapes: "Sequence[Any]", values: "Sequence[Any]") -> "Camera":
    """The side that shows most of the first scalars, else of the first mesh."""
    from o3dmark.view import best_side

    pairs = zip(shapes, values, strict=True)
    return best_side(*next((pair for pair in pairs if pair[1] is not None), (shapes[0], None)))


def _exaggerated(shapes: "Sequence[Any]", factor: float) -> "list[Any]":
    """The shapes, those with the first one's triangles as far from it as if they had been moved ``factor`` times."""
    from o3dmark.mesh.surface import is_cloud
    from o3dmark.view import Displacement, agree

    first, *others = shapes
    alike = [not is_cloud(first) and not is_cloud(other) and agree(first, other) for other in others]
    if not any(alike):
        raise MeshError("none of the meshes has the first one's triangles: there is no displacement to exaggerate")
    pairs = zip(others, alike, strict=True)
    return [first, *(Displacement.of(first, m).exaggerated(factor) if same else m for m, same in pairs)]


def _scalars(kind: str | None, shapes: "Sequence[Any]") -> "list[Any]":
    """For each mesh the values to colour it by, or None."""
    if kind is None:
        return [None] * len(shapes)
    if kind == "saliency":
        from o3dmark.mesh.saliency import Saliency

        return [Saliency()(shape) for shape in shapes]
    import numpy as np

    from o3dmark.mesh.proximity import closest_points
    from o3dmark.mesh.surface import Surface, is_cloud

    first = Surface.of(shapes[0])
    points = [np.array(shape.points if is_cloud(shape) else shape.vertices) for shape in shapes[1:]]
    return [None, *(100.0 * closest_points(each, first).distance / first.diagonal for each in points)]


def _found(key: Path, mark: "Watermark | None", assets: "Sequence[Asset]") -> "list[PatchesFound]":
    """The patches in each of the files."""
    from o3dmark.coding.keys import Key
    from o3dmark.marking import patches_found

    secret = Key.load(key)
    return [patches_found(asset, mark, secret) for asset in assets]


def _with_patches(panels: "Sequence[Panel]", found: "Sequence[PatchesFound]", camera: "Camera | None") -> "list[Panel]":
    """Panels of meshes, as `patches_panel` has them; with a camera, from there."""
    from dataclasses import replace

    from o3dmark.coding.words import one_in
    from o3dmark.view import patches_panel

    notes = [f"by chance {one_in(each.log10_p)}" if each.patches else "" for each in found]
    drawn = zip(panels, found, notes, strict=True)
    made = [patches_panel(panel.title, panel.mesh, each.patches, note) for panel, each, note in drawn]
    return made if camera is None else [replace(panel, camera=camera) for panel in made]
