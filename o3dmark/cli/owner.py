"""The owner's commands: keygen, embed, extract, detect."""

import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from o3dmark.cli._arguments import AnyScale, In, Json, Mirrored, Out, Overwrite, Verbose
from o3dmark.cli._talk import print_answer, print_result, printable, say, since
from o3dmark.coding.words import mistaken, one_in
from o3dmark.errors import ConversionError, MeshError

if TYPE_CHECKING:
    from o3dmark.coding.detection import Detection
    from o3dmark.coding.keys import Key
    from o3dmark.files import Asset, Destination
    from o3dmark.marking import Marked, PartDetection, PartReading
    from o3dmark.watermark import Reading, Watermark

KeyFile = Annotated[Path, typer.Option("--key", metavar="FILE", help="The owner's key file; see keygen.")]
Method = Annotated[str | None, typer.Option("--method", metavar="SPEC", help="Method and options, like name:a=1,b=2.")]
Profile = Annotated[str | None, typer.Option("--profile", metavar="NAME", help="Published parameters; see list.")]
NBits = Annotated[int | None, typer.Option("--n-bits", metavar="N", help="Raw bits between method and code.")]
Reference = Annotated[
    Path | None, typer.Option("--reference", metavar="COVER", help="The unmarked mesh, for informed extraction.")
]
_COSTS = ("mrms", "hausdorff", "max_displacement", "jnd", "strength_by")  # null where nothing was marked
_TOLD_OF_MARK = ("output", "profile", "message", "strength")
_TOLD_OF_MESSAGE = ("p_value", "corrected_bits", "profile", "part")
_TOLD_OF_MARK_THERE = ("p_value", "false_positive_rate", "matches", "n_bits", "profile", "part")
_MISSING = {
    "solid": "only patches tell the message",
    "patches": "no patch fits there unseen, so that a fragment will not be read",
}


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
    overwrite: Overwrite = False,
    verbose: Verbose = False,
    json: Json = False,
) -> None:
    """Hide a message: OUT is the file IN with its positions moved. What cannot be read back is not written; exit 1."""
    from o3dmark import marking, watermark
    from o3dmark.coding.keys import Key
    from o3dmark.files import ASSETS, destination, open_asset
    from o3dmark.profiles import PROFILES

    if (message is None) == (bits is None):
        raise typer.BadParameter("give either --message or --bits")
    if output.suffix.lower() not in ASSETS:
        raise typer.BadParameter(f"the ending of {output.name} is none of {', '.join(ASSETS)}")
    asset = open_asset(source)
    target = destination(asset, output, overwrite=overwrite)
    secret = Key.load(key)
    hidden = str(message) if bits is None else watermark.parse_bits(bits)
    mark = _watermark(method, profile, n_bits if bits is None else len(hidden))
    started = time.perf_counter()
    chosen = _profile(method, profile)
    try:
        if message is not None and (method, profile, n_bits) == (None, None, None):
            marked, chosen, refused = marking.embed_by_any(asset, message, secret, name=output.name, names=target.names)
            mark = PROFILES[chosen]
            for other, why in refused.items():
                say(f"{other} does not do: {why}")
            if refused:
                say(f"marked with {chosen}")
        else:
            marked = marking.embed(asset, mark, hidden, secret, name=output.name, names=target.names)
    except ConversionError:  # whatever the profile
        raise
    except MeshError as error:
        error.args = (_with_advice(str(error), asset, mark, message, secret),)
        raise
    if marked.verified:
        target.write(marked.files)
    report: dict[str, Any] = {"output": str(output) if marked.verified else None, "profile": chosen}
    report |= mark.to_dict() | {"message": message, "bits": bits, "verified": marked.verified}
    strength = marking.strength(marked, mark.method)
    cost = dict.fromkeys(_COSTS) if strength is None else strength.to_dict()
    report |= cost | {"strength": None if strength is None else strength.words}
    report |= {"marked": [part.name for part in marked.parts], "dropped": list(marked.dropped)}
    report |= {"left": [vars(each) for each in marked.left], "missing": list(target.missing)}
    report |= {"files": sorted({*marked.files, *target.copies}) if marked.verified else []}
    layers = marking.layers_read(marked, mark, hidden, secret)
    report |= {"layers": [vars(each) for each in layers]}
    report |= {"seconds": since(started)}
    done = f"Marked, read back and written: {output.name}." if marked.verified else "Nothing was written."
    print_answer(done, report, _TOLD_OF_MARK, json, verbose)
    if strength is not None and strength.by == "jnd":
        say(strength.words)
    for layer in layers:
        if not layer.read:
            say(f"{layer.words}: {_MISSING[layer.layer]}")
    _say_what_happened(marked, target)
    if not marked.verified:
        say(_with_advice("nothing was written: the mark cannot be read back", asset, mark, message, secret))
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
    any_scale: AnyScale = False,
    mirrored: Mirrored = False,
    verbose: Verbose = False,
    json: Json = False,
) -> None:
    """Read the message of a mesh, a scene or a point cloud. Exit code 1 when there is none."""
    from o3dmark import marking, watermark
    from o3dmark.coding.keys import Key
    from o3dmark.files import open_shape, read_mesh, read_shape
    from o3dmark.methods import Depth

    secret, mark, started = Key.load(key), _watermark(method, profile, n_bits), time.perf_counter()
    cover, depth = None if reference is None else read_mesh(reference), Depth(mirrored=mirrored, any_scale=any_scale)
    if raw:
        mark = replace(mark, method=mark.method.searching(depth))
        bits = watermark.raw_dict(mark.extract_bits(read_shape(source), secret, reference=cover))
        print_result(_about(mark, _profile(method, profile)) | bits | {"seconds": since(started)}, json)
        return
    found = marking.extract(
        open_shape(source),
        asked(method, profile, n_bits),
        secret,
        reference=cover,
        false_positive_rate=fpr,
        depth=depth,
    )
    about = _about_found(found.profile, mark, method, profile)
    result = found.reading.to_dict() | about | _where(found) | {"seconds": since(started)}
    print_answer(_read(found.reading), result, _TOLD_OF_MESSAGE, json, verbose)
    if not found.reading.found:
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
    any_scale: AnyScale = False,
    mirrored: Mirrored = False,
    verbose: Verbose = False,
    json: Json = False,
) -> None:
    """Is our mark there? Exit code 0 for yes, 1 for no. Knowing the message makes the test far sharper.

    With --message the question is whether it is that one: where another message of the same key reads better, the
    answer is no.
    """
    from o3dmark import marking
    from o3dmark.coding.keys import Key
    from o3dmark.files import open_shape, read_mesh
    from o3dmark.methods import Depth

    secret, mark, started = Key.load(key), _watermark(method, profile, n_bits), time.perf_counter()
    cover = None if reference is None else read_mesh(reference)
    found = marking.detect(
        open_shape(source),
        asked(method, profile, n_bits),
        secret,
        message,
        reference=cover,
        false_positive_rate=fpr,
        depth=Depth(mirrored=mirrored, any_scale=any_scale),
    )
    about = _about_found(found.profile, mark, method, profile)
    result = found.detection.to_dict() | about | _where(found) | {"seconds": since(started)}
    print_answer(_detected(found.detection), result, _TOLD_OF_MARK_THERE, json, verbose)
    if json and found.detection.other is not None:
        say(f"another message reads better: {printable(found.detection.other)}")
    if not found.detection.present:
        raise typer.Exit(1)


def _read(reading: "Reading") -> str:
    """What was read, as a sentence."""
    if reading.message is None:
        return "No message of this key was found."
    return f"Found: {reading.message}. {mistaken(reading.decoded.log10_p)}"


def _detected(detection: "Detection") -> str:
    """Whether the mark is there, as a sentence."""
    if detection.other is not None:
        return f"Not this mark: another message of the key reads better, {detection.other}."
    if not detection.present:
        return f"The mark was not found: chance shows as much {one_in(detection.log10_p)} times."
    return f"The mark is there. {mistaken(detection.log10_p)}"


def _about(mark: "Watermark", profile: str | None) -> dict[str, Any]:
    return {"method": mark.to_dict()["method"], "profile": profile, "n_bits": mark.n_bits}


def _about_found(found: str | None, mark: "Watermark", method: str | None, profile: str | None) -> dict[str, Any]:
    """The profile under which something was found, or the one that was asked for."""
    from o3dmark.profiles import PROFILES

    return _about(mark, _profile(method, profile)) if found is None else _about(PROFILES[found], found)


def _where(found: "PartReading | PartDetection") -> dict[str, Any]:
    """Which part of the file spoke, which layer of the mark, and which patches of the surface."""
    from o3dmark.mesh.patch import layer

    return {"part": found.part, "layer": layer(found.patches), "patches": [patch.to_dict() for patch in found.patches]}


def asked(method: str | None, profile: str | None, n_bits: int | None) -> "Watermark | None":
    """What a reader is to look for; None, where nothing says that, for all profiles."""
    return None if (method, profile, n_bits) == (None, None, None) else _watermark(method, profile, n_bits)


def _watermark(method: str | None, profile: str | None, n_bits: int | None) -> "Watermark":
    """The profile, with its method or number of bits replaced where the caller names another."""
    from o3dmark.methods import METHODS
    from o3dmark.profiles import DEFAULT_PROFILE, PROFILES

    mark = PROFILES[profile or DEFAULT_PROFILE]
    if method is not None:
        mark = replace(mark, method=METHODS.make(method))
    return mark if n_bits is None else replace(mark, n_bits=n_bits)


def _profile(method: str | None, profile: str | None) -> str | None:
    """The name of the profile in use; None where --method replaces its method."""
    from o3dmark.profiles import DEFAULT_PROFILE

    return (profile or DEFAULT_PROFILE) if method is None else None


def _with_advice(text: str, asset: "Asset", mark: "Watermark", message: str | None, key: "Key") -> str:
    """A refusal and what does work, which is tried; for raw bits, which have no code to be shorter with, nothing is."""
    from o3dmark.marking import advice

    return ". ".join(filter(None, [text, "" if message is None else advice(asset, mark, message, key)]))


def _say_what_happened(marked: "Marked", target: "Destination") -> None:
    for part in marked.left:
        say(f"left as it is: {part.part}: {part.why}")
    if marked.dropped:
        say(f"{target.path.suffix} does not hold, and so was dropped: {', '.join(marked.dropped)}")
    if target.missing:
        say(f"{marked.asset.name} refers to what is not there: {', '.join(target.missing)}")
