"""The owner's commands: keygen, embed, extract, detect."""

import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from o3dmark.cli._arguments import In, Json, Out
from o3dmark.cli._talk import print_result, say, since
from o3dmark.errors import SpecError

if TYPE_CHECKING:
    from o3dmark.watermark import Watermark

KeyFile = Annotated[Path, typer.Option("--key", metavar="FILE", help="The owner's key file; see keygen.")]
Method = Annotated[str | None, typer.Option("--method", metavar="SPEC", help="Method and options, like name:a=1,b=2.")]
Profile = Annotated[str | None, typer.Option("--profile", metavar="NAME", help="Published parameters; see list.")]
NBits = Annotated[int | None, typer.Option("--n-bits", metavar="N", help="Raw bits between method and code.")]
Reference = Annotated[
    Path | None, typer.Option("--reference", metavar="COVER", help="The unmarked mesh, for informed extraction.")
]


def keygen(file: Annotated[Path, typer.Argument(metavar="FILE", help="To be made.")], json: Json = False) -> None:
    """Make a key: 256 random bits, in a file that only you can read. An existing file is never overwritten."""
    from o3dmark.coding.keys import Key

    Key.generate().save(file)
    print_result({"output": str(file)}, json)


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
    from o3dmark.coding.keys import Key
    from o3dmark.files import read_mesh, replacing, write_mesh

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
        report |= _cost(cover, marked) | {"verified": verified, "seconds": since(started)}
        print_result(report, json)
        if not verified:
            say("nothing was kept: the mark cannot be read back from the file. Fewer bits, or another method, may do.")
            raise typer.Exit(1)


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
    from o3dmark.coding.keys import Key
    from o3dmark.files import read_mesh

    secret, mark, started = Key.load(key), _watermark(method, profile, n_bits), time.perf_counter()
    cover = None if reference is None else read_mesh(reference)
    about = {"method": mark.to_dict()["method"], "n_bits": mark.n_bits}
    if raw:
        bits = watermark.raw_dict(mark.extract_bits(read_mesh(source), secret, reference=cover))
        print_result(about | bits | {"seconds": since(started)}, json)
        return
    reading = mark.extract(read_mesh(source), secret, reference=cover, false_positive_rate=fpr)
    print_result(reading.to_dict() | about | {"seconds": since(started)}, json)
    if not reading.found:
        raise typer.Exit(1)


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
    from o3dmark.coding.keys import Key
    from o3dmark.files import read_mesh

    secret, mark, started = Key.load(key), _watermark(method, profile, n_bits), time.perf_counter()
    cover = None if reference is None else read_mesh(reference)
    found = mark.detect(read_mesh(source), secret, message, reference=cover, false_positive_rate=fpr)
    print_result(found.to_dict() | {"method": mark.to_dict()["method"], "seconds": since(started)}, json)
    if not found.present:
        raise typer.Exit(1)


def _watermark(method: str | None, profile: str | None, n_bits: int | None) -> "Watermark":
    """The profile, with its method or number of bits replaced where the caller names another."""
    from o3dmark.methods import METHODS
    from o3dmark.profiles import DEFAULT_PROFILE, PROFILES

    name = profile or DEFAULT_PROFILE
    if name not in PROFILES:
        raise SpecError(f"no profile is called {name!r}; there is {', '.join(PROFILES)}")
    mark = PROFILES[name]
    if method is not None:
        mark = replace(mark, method=METHODS.make(method))
    return mark if n_bits is None else replace(mark, n_bits=n_bits)


def _cost(cover: Any, marked: Any) -> dict[str, float | None]:
    """What the mark cost: lengths over the diagonal of the cover's bounding box."""
    from o3dmark.metrics.displacement import MaxDisplacement
    from o3dmark.metrics.distance import surface_distance

    distance = surface_distance(cover, marked)
    largest = MaxDisplacement()(cover, marked)
    return {"mrms": distance.mrms, "hausdorff": distance.hausdorff, "max_displacement": largest}
