"""Commands for meshes, marked or not: attack, compare, saliency, synth."""

import math
import time
from pathlib import Path
from typing import Annotated, Any

import typer

from o3dmark.cli._arguments import In, Json, Out, Overwrite, Seed
from o3dmark.cli._talk import print_result, say, since
from o3dmark.errors import SpecError


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


def _save_scalars(out: Path, shape: Any, values: Any) -> None:
    """Saliency as a picture, as numbers (numpy) or as the colours of the mesh or cloud it belongs to."""
    import numpy as np

    from o3dmark.files import replacing, write_shape
    from o3dmark.view import SALIENCY, coloured, render_scalars, save_png

    if out.suffix.lower() == ".png":
        save_png(out, render_scalars(shape, values, SALIENCY))
    elif out.suffix.lower() == ".npy":
        with replacing(out) as draft:
            np.save(draft, values)
    else:
        write_shape(out, coloured(shape, values))
