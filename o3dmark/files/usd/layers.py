"""USD layers through usd-core: opened in a folder of their own, and written with other values in a few attributes."""

import posixpath
import struct
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Tf, UsdUtils, Vt

from o3dmark.errors import MeshError
from o3dmark.files.references import inside
from o3dmark.files.usd import text
from o3dmark.files.usd.check import check_binary

Vectors: TypeAlias = NDArray[np.float32]

Edits: TypeAlias = Mapping[str, tuple[Vectors, Vectors]]
"""For the paths of attributes that are arrays of three numbers (n, 3): what they are, and what they are to be."""

_MOST_LAYERS = 1000


@contextmanager
def unpacked(name: str, files: Mapping[str, bytes], beside: Callable[[str], bytes]) -> Iterator[tuple[Any, list[str]]]:
    """The layer ``name`` of some files, opened in a temporary folder; and the layers that it refers to, by name.

    ``beside`` gives files that are not among them. Nothing else is there for the library to find.
    Errors: MeshError for a damaged layer, and of ``beside``.
    """
    with tempfile.TemporaryDirectory(prefix="o3dmark-") as folder, _quiet(name):
        layers: dict[str, Any] = {}
        waiting = [name]
        while waiting:
            here = waiting.pop()
            if here in layers:
                continue
            if len(layers) >= _MOST_LAYERS:
                raise MeshError(f"{name} is made of more than {_MOST_LAYERS} layers")
            target = Path(folder) / inside(Path(folder) / "scene", here).relative_to(folder)
            target.parent.mkdir(parents=True, exist_ok=True)
            content = files[here] if here in files else beside(here)
            target.write_bytes(content)
            if not text.is_text(content):
                check_binary(here, target)
            layers[here] = layer = Sdf.Layer.FindOrOpen(str(target))
            if layer is None:
                raise MeshError(f"{here} is damaged, or no USD layer")
            waiting += [relative(here, other) for other in layer.GetCompositionAssetDependencies() if other]
        yield layers[name], [other for other in layers if other != name]
        layers.clear()


@contextmanager
def _quiet(name: str) -> Iterator[None]:
    """What the library would print stays unsaid, and its errors are ours."""
    delegate = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        yield
    except Tf.ErrorException as error:
        raise MeshError(f"{name} is damaged: {_reason(error)}") from None
    except UnicodeDecodeError:
        raise MeshError(f"{name} is damaged: a word in it is not UTF-8") from None
    finally:
        del delegate


def _reason(error: Exception) -> str:
    """The first line of what the library says, without where in its own source it says so."""
    try:
        lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    except UnicodeDecodeError:  # it quotes the file
        lines = []
    return lines[0].rpartition(" : ")[2].strip("'") if lines else "it cannot be read"


def relative(layer: str, asset: str) -> str:
    """What a layer calls ``asset``, as a name relative to the folder of all."""
    asset = asset.partition(":SDF_FORMAT_ARGS:")[0].replace("\\", "/")
    leaves = asset.startswith("/") or "://" in asset
    return asset if leaves else posixpath.normpath(posixpath.join(posixpath.dirname(layer), asset))


def rewritten(name: str, content: bytes, edits: Edits) -> bytes:
    """A layer with other values: its other bytes as they were where that can be made sure of, else as the library
    writes it. Errors: MeshError where what the library writes is not the same layer."""
    patched = _patched_text(name, content, edits) if text.is_text(content) else _patched_crate(content, edits)
    with _opened(name, content) as layer:
        for path, (_, after) in edits.items():
            layer.GetAttributeAtPath(path).default = Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(after))
        if patched is not None and _says(name, patched, layer):
            return patched
        written = layer.ExportToString().encode() if text.is_text(content) else _exported(layer)
        if not _says(name, written, layer):
            raise MeshError(f"{name} is damaged: usd-core cannot write again what it reads in it")
        return written


def _says(name: str, content: bytes, layer: Any) -> bool:
    """Whether some bytes are a layer that says the same as another."""
    try:
        with _opened(name, content) as found:
            return _alike(found, layer)
    except MeshError:
        return False


def _alike(one: Any, other: Any) -> bool:
    """Whether two layers say the same."""
    specs, others = _specs(one), _specs(other)
    return specs.keys() == others.keys() and all(
        spec.ListInfoKeys() == others[path].ListInfoKeys()
        and all(spec.GetInfo(key) == others[path].GetInfo(key) for key in spec.ListInfoKeys())
        for path, spec in specs.items()
    )


def _specs(layer: Any) -> dict[str, Any]:
    """All that a layer says something of, by path."""
    paths: list[Any] = []
    layer.Traverse("/", paths.append)
    found = {str(path): layer.GetObjectAtPath(path) for path in paths}
    return {path: spec for path, spec in found.items() if spec}  # the targets of relationships are part of those


@contextmanager
def _opened(name: str, content: bytes) -> Iterator[Any]:
    """A layer alone: nothing that it refers to is looked for."""
    with tempfile.TemporaryDirectory(prefix="o3dmark-") as folder, _quiet(name):
        path = Path(folder) / ("layer.usda" if text.is_text(content) else "layer.usdc")
        path.write_bytes(content)
        yield Sdf.Layer.FindOrOpen(str(path))


def _exported(layer: Any) -> bytes:
    with tempfile.TemporaryDirectory(prefix="o3dmark-") as folder:
        path = Path(folder) / "layer.usdc"
        layer.Export(str(path))
        return path.read_bytes()


def _patched_text(name: str, content: bytes, edits: Edits) -> bytes | None:
    spans = text.arrays(name, content)
    places = {}
    for path, (before, after) in edits.items():
        span = spans.get(path)
        if span is None:
            return None
        numbers = text.numbers(content, span).astype(np.float32)
        if not np.array_equal(numbers, before.ravel(), equal_nan=True):
            return None
        places[span] = before.ravel(), after.ravel()
    return text.with_numbers(content, places)


def _patched_crate(content: bytes, edits: Edits) -> bytes | None:
    """In the binary form such arrays stand uncompressed behind their length; None where one is not there just once."""
    result = bytearray(content)
    for before, after in edits.values():
        wanted = struct.pack("<Q", len(before)) + before.astype("<f4").tobytes()
        at = content.find(wanted)
        if at < 0 or content.find(wanted, at + 1) >= 0:
            return None
        result[at + 8 : at + len(wanted)] = after.astype("<f4").tobytes()
    return bytes(result)
