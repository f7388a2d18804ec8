"""Commands for meshes, marked or not: attack, compare, saliency, view, synth."""

import math
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from o3dmark.cli._arguments import In, Json, Out, Overwrite, Seed
from o3dmark.cli._talk import print_result, say, since
from o3dmark.cli.owner import Method, NBits, Profile, asked
from o3dmark.errors import SpecError

if TYPE_CHECKING:
    from o3dmark.files import Asset
    from o3dmark.marking import PatchesFound
    from o3dmark.view import Panel
    from o3dmark.watermark import Watermark


def attack(
    source: In,
    output: Out,
    specs: Annotated[list[str], typer.Argument(metavar="SPEC...", help="Attacks, applied left to right; see list.")],
    seed: Seed = 0,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Do to a mesh what the world does: noise, smoothing, simplification, cropping, ..."""
    from o3dmark.attacks import ATTACKS, attack_all
    from o3dmark.files import check_free, read_mesh, write_mesh
    from o3dmark.registry import spec_of

    check_free(output, source, overwrite=overwrite)
    attacks = [ATTACKS.make(spec) for spec in specs]
    mesh = attack_all(read_mesh(source), attacks, seed)
    write_mesh(output, mesh)
    size = {"vertices": len(mesh.vertices), "triangles": len(mesh.triangles)}
    print_result({"output": str(output), "attacks": [spec_of(a) for a in attacks], **size}, json)


def compare(
    reference: Annotated[Path, typer.Argument(metavar="REFERENCE", help="The mesh that lengths are relative to.")],
    other: Annotated[Path, typer.Argument(metavar="OTHER", help="The distorted mesh.")],
    metric: Annotated[list[str] | None, typer.Option(metavar="SPEC", help="Instead of all; may be repeated.")] = None,
    json: Json = False,
) -> None:
    """Measure what a mark or an attack cost. A metric that cannot be had is null, and says why on stderr."""
    from o3dmark.errors import MeshError
    from o3dmark.files import read_mesh
    from o3dmark.metrics import METRICS

    metrics = {spec: METRICS.make(spec) for spec in metric or METRICS}
    meshes = read_mesh(reference), read_mesh(other)
    values, refused = dict[str, float | None](), dict[str, MeshError]()
    for spec, each in metrics.items():
        try:
            value = each(*meshes)
            values[spec] = float(value) if math.isfinite(value) else None
        except MeshError as error:
            values[spec], refused[spec] = None, error
    general = [refused.get(spec) for spec, each in metrics.items() if not each.needs_equal_connectivity]
    if general and all(general):
        raise next(filter(None, general))  # not the pair is at fault, but a mesh
    for reason in dict.fromkeys(map(str, refused.values())):
        say(f"{', '.join(spec for spec in refused if str(refused[spec]) == reason)}: {reason}")
    print_result(values, json)


def saliency(
    source: In,
    out: Annotated[
        Path | None, typer.Option(metavar="PLY|NPY|PNG", help="A coloured mesh or cloud, the values, or a picture.")
    ] = None,
    scales: Annotated[str, typer.Option(help="sigma in epsilons; '2' is the paper's.")] = "2,3,4,5,6",
    epsilon: Annotated[float, typer.Option(help="Unit of the scales, over the bounding-box diagonal.")] = 0.003,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Mesh saliency of a mesh or a point cloud."""
    from o3dmark.files import check_free, read_shape
    from o3dmark.mesh.saliency import Saliency

    if out is not None:
        check_free(out, source, overwrite=overwrite)
    try:
        measure = Saliency(scales=tuple(float(scale) for scale in scales.split(",")), epsilon=epsilon)
    except ValueError as error:
        raise SpecError(f"--scales {scales}: {error}") from None
    shape, started = read_shape(source), time.perf_counter()
    values = measure(shape)
    seconds = since(started)
    if out is not None:
        _save_scalars(out, shape, values)
    stats = {"min": float(values.min()), "max": float(values.max()), "mean": float(values.mean())}
    print_result({"output": None if out is None else str(out), **stats, "seconds": seconds}, json)


def view(
    meshes: Annotated[list[Path], typer.Argument(metavar="MESH...", help="One or more meshes.")],
    scalars: Annotated[str | None, typer.Option(help="saliency, or distance from the first mesh.")] = None,
    png: Annotated[Path | None, typer.Option(metavar="FILE", help="Write a picture; open no window.")] = None,
    zebra: Annotated[bool, typer.Option("--zebra", help="As mirrors under light tubes; in a picture only.")] = False,
    key: Annotated[
        Path | None, typer.Option(metavar="FILE", help="With the patches that a key file finds; in a picture only.")
    ] = None,
    method: Method = None,
    profile: Profile = None,
    n_bits: NBits = None,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Look at meshes side by side, in a window or, without a display, as a picture."""
    from o3dmark.files import check_free, open_asset, whole_mesh
    from o3dmark.view import Panel, save_png, sheet, show

    if zebra and (png is None or scalars is not None):
        raise SpecError("--zebra is for pictures, without scalars: give --png FILE" + " alone" * (scalars is not None))
    if key is not None and (png is None or scalars is not None or zebra):
        raise SpecError("--key is for pictures, with neither scalars nor stripes: give --png FILE")
    mark = asked(method, profile, n_bits)
    if key is None and mark is not None:
        raise SpecError("--method, --profile and --n-bits say what --key is to find: give --key FILE")
    if png is not None:
        check_free(png, *meshes, *filter(None, (key,)), overwrite=overwrite)
    assets = [open_asset(path) for path in meshes]
    shapes = [whole_mesh(asset) for asset in assets]
    values = _scalars(scalars, shapes)
    found = None if key is None else _found(key, mark, assets)
    if png is None:
        show(shapes, values)
    else:
        panels = [
            Panel(path.name, shape, scalars=value, bar=scalars or "", look="zebra" if zebra else "clay")
            for path, shape, value in zip(meshes, shapes, values, strict=True)
        ]
        panels = panels if found is None else _with_patches(panels, found)
        save_png(png, sheet(panels, columns=min(len(panels), 3)))
    told = None if found is None else [[patch.to_dict() for patch in each.patches] for each in found]
    about = {"meshes": [str(path) for path in meshes], "patches": told}
    print_result({"output": None if png is None else str(png)} | about, json)


def synth(
    name: Annotated[str, typer.Argument(metavar="NAME", help="A shape and its options, like bimba:vertices=4000.")],
    output: Out,
    seed: Seed = 0,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Make one of the procedural test shapes."""
    from o3dmark.files import check_free, write_mesh
    from o3dmark.synthetic import make

    check_free(output, overwrite=overwrite)
    mesh = make(name, seed)
    write_mesh(output, mesh)
    print_result({"output": str(output), "vertices": len(mesh.vertices), "triangles": len(mesh.triangles)}, json)


def _scalars(kind: str | None, shapes: "Sequence[Any]") -> "list[Any]":
    """For each mesh the values to colour it by, or None."""
    if kind is None:
        return [None] * len(shapes)
    if kind == "saliency":
        from o3dmark.mesh.saliency import Saliency

        return [Saliency()(shape) for shape in shapes]
    if kind == "distance":
        from o3dmark.mesh.proximity import closest_points
        from o3dmark.mesh.surface import Surface, mesh_arrays

        first = Surface.of(shapes[0])
        distances = [closest_points(mesh_arrays(shape)[0], first).distance / first.diagonal for shape in shapes[1:]]
        return [None, *distances]
    raise SpecError(f"--scalars is saliency or distance, not {kind!r}")


def _found(key: Path, mark: "Watermark | None", assets: "Sequence[Asset]") -> "list[PatchesFound]":
    """The patches in each of the files."""
    from o3dmark.coding.keys import Key
    from o3dmark.marking import patches_found

    secret = Key.load(key)
    return [patches_found(asset, mark, secret) for asset in assets]


def _with_patches(panels: "Sequence[Panel]", found: "Sequence[PatchesFound]") -> "list[Panel]":
    """Panels of meshes, as `patches_panel` has them."""
    from o3dmark.copies.words import one_in
    from o3dmark.view import patches_panel

    notes = [f"by chance {one_in(each.log10_p)}" if each.patches else "" for each in found]
    drawn = zip(panels, found, notes, strict=True)
    return [patches_panel(panel.title, panel.mesh, each.patches, note) for panel, each, note in drawn]


def _save_scalars(out: Path, shape: Any, values: Any) -> None:
    """Saliency as a picture, as numbers (numpy) or as the colours of the mesh or cloud it belongs to."""
    import numpy as np

    from o3dmark.files import replacing, write_shape
    from o3dmark.view import coloured, render_scalars, save_png

    if out.suffix.lower() == ".png":
        save_png(out, render_scalars(shape, values, "saliency"))
    elif out.suffix.lower() == ".npy":
        with replacing(out) as draft:
            np.save(draft, values)
    else:
        write_shape(out, coloured(shape, values))
