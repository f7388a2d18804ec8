"""The command line: stdout is data, stderr is talk, the exit code is the answer.

0 done or found; 1 ran well and the answer is no; 2 usage; 3 bad input or a library underneath failed. Keys and messages
never appear in logs or errors. Heavy libraries are imported by the commands, so that --help is quick.
"""

import json as json_text
import math
import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer
from rich.console import Console
from rich.table import Table

from o3dmark.errors import BackendError, O3dmarkError, SpecError

if TYPE_CHECKING:
    from o3dmark.watermark import Watermark

app = typer.Typer(
    name="o3dmark",
    help="Hide an ownership mark in 3-D meshes, and read it back after whatever the world did to them.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

In = Annotated[Path, typer.Argument(metavar="IN", help="A mesh: PLY, OBJ, OFF, STL, GLB or glTF.")]
Out = Annotated[Path, typer.Argument(metavar="OUT", help="The file to write; its ending says the format.")]
KeyFile = Annotated[Path, typer.Option("--key", metavar="FILE", help="The owner's key file; see keygen.")]
Method = Annotated[str | None, typer.Option("--method", metavar="SPEC", help="Method and options, like name:a=1,b=2.")]
Profile = Annotated[str | None, typer.Option("--profile", metavar="NAME", help="Published parameters; see list.")]
NBits = Annotated[int | None, typer.Option("--n-bits", metavar="N", help="Raw bits between method and code.")]
Reference = Annotated[
    Path | None, typer.Option("--reference", metavar="COVER", help="The unmarked mesh, for informed extraction.")
]
Seed = Annotated[int, typer.Option("--seed", metavar="N", help="Makes the randomness repeatable.")]
_FOR_PROGRAMS = {"soft", "log10_p"}  # of no use in a table
_UsageError: Any = typer.BadParameter.__base__  # its own module differs between versions of typer

Json = Annotated[bool, typer.Option("--json", help="One JSON object on stdout instead of a table.")]


@app.command()
def keygen(file: Annotated[Path, typer.Argument(metavar="FILE", help="To be made.")], json: Json = False) -> None:
    """Make a key: 256 random bits, in a file that only you can read. An existing file is never overwritten."""
    from o3dmark.keys import Key

    Key.generate().save(file)
    _print({"output": str(file)}, json)


@app.command()
def embed(
    source: In,
    output: Out,
    key: KeyFile,
    message: Annotated[str | None, typer.Option(metavar="TEXT|hex:...", help="What to hide.")] = None,
    bits: Annotated[str | None, typer.Option(metavar="0101...", help="Raw bits instead, past the code.")] = None,
    method: Method = None,
    profile: Profile = None,
    n_bits: NBits = None,
    json: Json = False,
) -> None:
    """Hide a message in a mesh. What was written is read back, and discarded with exit code 1 if that fails."""
    from o3dmark import watermark
    from o3dmark.files import read_mesh, replacing, write_mesh
    from o3dmark.keys import Key

    if (message is None) == (bits is None):
        raise typer.BadParameter("give either --message or --bits")
    if output.exists() and source.exists() and output.samefile(source):
        raise typer.BadParameter("OUT is IN: the unmarked mesh would be lost")
    secret = Key.load(key)
    raw = None if bits is None else watermark.parse_bits(bits)
    mark = _watermark(method, profile, n_bits if raw is None else len(raw))
    started = time.perf_counter()
    cover = read_mesh(source)
    marked = mark.embed(cover, str(message), secret) if raw is None else mark.embed_bits(cover, raw, secret)
    with replacing(output) as draft:
        write_mesh(draft, marked)
        written, reference = read_mesh(draft), cover if mark.method.informed else None
        if raw is None:
            verified = mark.extract(written, secret, reference=reference).message == message
        else:
            verified = bool((mark.extract_bits(written, secret, reference=reference).bits == raw).all())
        report = {"output": str(output) if verified else None, **mark.to_dict(), "message": message, "bits": bits}
        report |= _cost(cover, marked) | {"verified": verified, "seconds": _since(started)}
        _print(report, json)
        if not verified:
            _say("nothing was kept: the mark cannot be read back from the file. Fewer bits, or another method, may do.")
            raise typer.Exit(1)


@app.command()
def extract(
    source: In,
    key: KeyFile,
    method: Method = None,
    profile: Profile = None,
    n_bits: NBits = None,
    raw: Annotated[bool, typer.Option("--raw", help="Only the raw bits, past the code.")] = False,
    fpr: Annotated[float, typer.Option(help="How often a wrong key may yield a message.")] = 1e-4,
    reference: Reference = None,
    json: Json = False,
) -> None:
    """Read the message. Exit code 1 when there is none."""
    from o3dmark import watermark
    from o3dmark.files import read_mesh
    from o3dmark.keys import Key

    secret, mark, started = Key.load(key), _watermark(method, profile, n_bits), time.perf_counter()
    cover = None if reference is None else read_mesh(reference)
    about = {"method": mark.to_dict()["method"], "n_bits": mark.n_bits}
    if raw:
        bits = watermark.raw_dict(mark.extract_bits(read_mesh(source), secret, reference=cover))
        _print(about | bits | {"seconds": _since(started)}, json)
        return
    reading = mark.extract(read_mesh(source), secret, reference=cover, false_positive_rate=fpr)
    _print(reading.to_dict() | about | {"seconds": _since(started)}, json)
    if not reading.found:
        raise typer.Exit(1)


@app.command()
def detect(
    source: In,
    key: KeyFile,
    message: Annotated[str | None, typer.Option(metavar="TEXT|hex:...", help="The message, if known.")] = None,
    fpr: Annotated[float, typer.Option(help="False-positive rate of the answer.")] = 1e-6,
    method: Method = None,
    profile: Profile = None,
    n_bits: NBits = None,
    reference: Reference = None,
    json: Json = False,
) -> None:
    """Is our mark there? Exit code 0 for yes, 1 for no. Knowing the message makes the test far sharper."""
    from o3dmark.files import read_mesh
    from o3dmark.keys import Key

    secret, mark, started = Key.load(key), _watermark(method, profile, n_bits), time.perf_counter()
    cover = None if reference is None else read_mesh(reference)
    found = mark.detect(read_mesh(source), secret, message, reference=cover, false_positive_rate=fpr)
    _print(found.to_dict() | {"method": mark.to_dict()["method"], "seconds": _since(started)}, json)
    if not found.present:
        raise typer.Exit(1)


@app.command()
def attack(
    source: In,
    output: Out,
    specs: Annotated[list[str], typer.Argument(metavar="SPEC...", help="Attacks, applied left to right; see list.")],
    seed: Seed = 0,
    json: Json = False,
) -> None:
    """Do to a mesh what the world does: noise, smoothing, simplification, cropping, ..."""
    from o3dmark.attacks import ATTACKS, attack_all
    from o3dmark.files import read_mesh, write_mesh
    from o3dmark.registry import spec_of

    attacks = [ATTACKS.make(spec) for spec in specs]
    mesh = attack_all(read_mesh(source), attacks, seed)
    write_mesh(output, mesh)
    size = {"vertices": len(mesh.vertices), "triangles": len(mesh.triangles)}
    _print({"output": str(output), "attacks": [spec_of(a) for a in attacks], **size}, json)


@app.command()
def compare(
    reference: Annotated[Path, typer.Argument(metavar="REFERENCE", help="The mesh that lengths are relative to.")],
    other: Annotated[Path, typer.Argument(metavar="OTHER", help="The distorted mesh.")],
    metric: Annotated[list[str] | None, typer.Option(metavar="SPEC", help="Instead of all; may be repeated.")] = None,
    json: Json = False,
) -> None:
    """Measure what a mark or an attack cost. A metric that needs equal triangles is null where they differ."""
    from o3dmark.files import read_mesh
    from o3dmark.metrics import METRICS

    metrics = {spec: METRICS.make(spec) for spec in metric or METRICS}
    meshes = read_mesh(reference), read_mesh(other)
    _print({spec: _value(each, *meshes) for spec, each in metrics.items()}, json)


@app.command()
def saliency(
    source: In,
    out: Annotated[
        Path | None, typer.Option(metavar="PLY|NPY|PNG", help="A coloured mesh or cloud, the values, or a picture.")
    ] = None,
    scales: Annotated[str, typer.Option(help="sigma in epsilons; '2' is the paper's.")] = "2,3,4,5,6",
    epsilon: Annotated[float, typer.Option(help="Unit of the scales, over the bounding-box diagonal.")] = 0.003,
    json: Json = False,
) -> None:
    """Mesh saliency of a mesh or a point cloud."""
    from o3dmark.files import read_shape
    from o3dmark.saliency import Saliency

    try:
        measure = Saliency(scales=tuple(float(scale) for scale in scales.split(",")), epsilon=epsilon)
    except ValueError as error:
        raise SpecError(f"--scales {scales}: {error}") from None
    shape, started = read_shape(source), time.perf_counter()
    values = measure(shape)
    seconds = _since(started)
    if out is not None:
        _save_scalars(out, shape, values)
    stats = {"min": float(values.min()), "max": float(values.max()), "mean": float(values.mean())}
    _print({"output": None if out is None else str(out), **stats, "seconds": seconds}, json)


@app.command()
def view(
    meshes: Annotated[list[Path], typer.Argument(metavar="MESH...", help="One or more meshes.")],
    scalars: Annotated[str | None, typer.Option(help="saliency, or distance from the first mesh.")] = None,
    png: Annotated[Path | None, typer.Option(metavar="FILE", help="Write a picture; open no window.")] = None,
    json: Json = False,
) -> None:
    """Look at meshes side by side, in a window or, without a display, as a picture."""
    from o3dmark.files import read_mesh
    from o3dmark.view import Panel, save_png, sheet, show

    shapes = [read_mesh(path) for path in meshes]
    values = _scalars(scalars, shapes)
    if png is None:
        show(shapes, values)
    else:
        panels = [
            Panel(path.name, shape, scalars=value, bar=scalars or "")
            for path, shape, value in zip(meshes, shapes, values, strict=True)
        ]
        save_png(png, sheet(panels, columns=min(len(panels), 3)))
    _print({"output": None if png is None else str(png), "meshes": [str(path) for path in meshes]}, json)


@app.command()
def synth(
    name: Annotated[str, typer.Argument(metavar="NAME", help="A shape and its options, like bust:vertices=4000.")],
    output: Out,
    seed: Seed = 0,
    json: Json = False,
) -> None:
    """Make one of the procedural test shapes."""
    from o3dmark.files import write_mesh
    from o3dmark.synthetic import make

    mesh = make(name, seed)
    write_mesh(output, mesh)
    _print({"output": str(output), "vertices": len(mesh.vertices), "triangles": len(mesh.triangles)}, json)


@app.command("list")
def list_(
    kind: Annotated[str, typer.Argument(metavar="KIND", help="methods, attacks, metrics, codes, shapes or profiles.")],
    json: Json = False,
) -> None:
    """What there is, with every option, its default and its unit."""
    from o3dmark.registry import describe

    registry = _registry(kind)
    if isinstance(registry, Mapping):
        _print({name: each.to_dict() for name, each in registry.items()}, json)
        return
    columns = ("option", "type", "default", "meaning")
    entries: dict[str, Any] = {
        name: {
            "summary": (registry[name].__doc__ or "").strip().splitlines()[0],
            "options": [
                dict(zip(("option", "type", "default", "meaning"), row, strict=True))
                for row in describe(registry[name])
            ],
        }
        for name in registry
    }
    if json:
        _print(entries, json)
        return
    table = Table("name", *columns, box=None, pad_edge=False)
    for name, entry in entries.items():
        table.add_row(name, "", "", "", entry["summary"], style="bold")
        for row in entry["options"]:
            table.add_row("", row["option"], row["type"], str(row["default"]), row["meaning"])
    Console(soft_wrap=not sys.stdout.isatty()).print(table)


@app.command()
def bench(
    spec: Annotated[Path, typer.Argument(metavar="SPEC.toml", help="The campaign; see scripts/campaigns.")],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Where rows go; what is there is not repeated.")],
    workers: Annotated[int | None, typer.Option(metavar="N", help="Processes; by default one a core.")] = None,
    dask: Annotated[str | None, typer.Option(metavar="ADDRESS", help="A Dask scheduler, instead of processes.")] = None,
    meshes: Annotated[Path | None, typer.Option(metavar="DIR", help="Folder of the campaign's real meshes.")] = None,
    json: Json = False,
) -> None:
    """Run a campaign: every mesh marked by every method, attacked by everything, read. Interrupted, it can go on."""
    from o3dmark.cli_bench import run_campaign

    words = [f"o3dmark bench {spec} --out {out}"] + ([] if meshes is None else [f"--meshes {meshes}"])
    _print(run_campaign(spec, out, workers, dask, meshes, " ".join(words)), json)


@app.command()
def report(
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="What bench wrote to.")], json: Json = False
) -> None:
    """Write DIR/report.md and DIR/report.html: tables beside the paper's, curves, pictures."""
    from o3dmark.report import write_report

    markdown, page = write_report(directory)
    _print({"markdown": str(markdown), "html": str(page)}, json)


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run the command line and leave with its exit code."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        code = app(words, standalone_mode=False) or 0
    except _UsageError as error:
        error.show()
        code = _fail("UsageError", error.format_message(), 2, "--json" in words, talk=False)
    except O3dmarkError as error:
        code = _fail(type(error).__name__, str(error), error.exit_code, "--json" in words)
    except (OSError, MemoryError) as error:
        code = _fail(
            BackendError.__name__, f"{type(error).__name__}: {error}", BackendError.exit_code, "--json" in words
        )
    except (KeyboardInterrupt, typer.Abort):
        code = 130
    sys.exit(code)


def _fail(name: str, text: str, code: int, json: bool, talk: bool = True) -> int:
    if json:
        print(json_text.dumps({"error": name, "message": text}))
    elif talk:
        _say(text)
    return code


def _watermark(method: str | None, profile: str | None, n_bits: int | None) -> "Watermark":
    """The profile, with its method or number of bits replaced where the caller names another."""
    from dataclasses import replace

    from o3dmark.methods import METHODS
    from o3dmark.watermark import DEFAULT_PROFILE, PROFILES

    name = profile or DEFAULT_PROFILE
    if name not in PROFILES:
        raise SpecError(f"no profile is called {name!r}; there is {', '.join(PROFILES)}")
    mark = PROFILES[name]
    if method is not None:
        mark = replace(mark, method=METHODS.make(method))
    return mark if n_bits is None else replace(mark, n_bits=n_bits)


def _registry(kind: str) -> Any:
    from o3dmark.attacks import ATTACKS
    from o3dmark.methods import METHODS
    from o3dmark.metrics import METRICS
    from o3dmark.payload import CODES
    from o3dmark.synthetic import SHAPES
    from o3dmark.watermark import PROFILES

    kinds = {
        "methods": METHODS,
        "attacks": ATTACKS,
        "metrics": METRICS,
        "codes": CODES,
        "shapes": SHAPES,
        "profiles": PROFILES,
    }
    if kind not in kinds:
        raise SpecError(f"no list of {kind!r}; there is {', '.join(kinds)}")
    return kinds[kind]


def _scalars(kind: str | None, shapes: "Sequence[Any]") -> "list[Any]":
    """For each mesh the values to colour it by, or None."""
    if kind is None:
        return [None] * len(shapes)
    if kind == "saliency":
        from o3dmark.saliency import Saliency

        return [Saliency()(shape) for shape in shapes]
    if kind == "distance":
        from o3dmark.closest import closest_points
        from o3dmark.mesh import Surface, mesh_arrays

        first = Surface.of(shapes[0])
        distances = [closest_points(mesh_arrays(shape)[0], first).distance / first.diagonal for shape in shapes[1:]]
        return [None, *distances]
    raise SpecError(f"--scalars is saliency or distance, not {kind!r}")


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


def _cost(cover: Any, marked: Any) -> dict[str, float | None]:
    """What the mark cost: lengths over the diagonal of the cover's bounding box."""
    from o3dmark.metrics.displacement import MaxDisplacement
    from o3dmark.metrics.distance import surface_distance

    distance = surface_distance(cover, marked)
    largest = MaxDisplacement()(cover, marked)
    return {"mrms": distance.mrms, "hausdorff": distance.hausdorff, "max_displacement": largest}


def _value(metric: Any, reference: Any, distorted: Any) -> float | None:
    """The metric's value, or None where it needs equal triangles and they differ, or where it is infinite."""
    from o3dmark.errors import MeshError

    try:
        value = metric(reference, distorted)
    except MeshError:
        if metric.needs_equal_connectivity:
            return None
        raise
    return float(value) if math.isfinite(value) else None


def _since(started: float) -> float:
    return round(time.perf_counter() - started, 3)


def _print(result: Mapping[str, Any], json: bool) -> None:
    """One object on stdout: JSON, or a table of two columns."""
    if json:
        print(json_text.dumps(result))
        return
    table = Table(box=None, show_header=False, pad_edge=False)
    for name, value in result.items():
        if name not in _FOR_PROGRAMS:
            table.add_row(name, _text(value))
    Console(soft_wrap=True, highlight=False).print(table)


def _text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {_text(each)}" for name, each in value.items())
    if isinstance(value, Iterable) and not isinstance(value, str):
        return " ".join(_text(each) for each in value)
    return "-" if value is None else str(value)


def _say(text: str) -> None:
    print(text, file=sys.stderr)
