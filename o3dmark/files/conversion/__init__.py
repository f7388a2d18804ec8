"""Another format than a file has: a conversion, which says all that it drops.

    done = convert(asset, Path("bust.glb"), open_asset)   # nothing is written
    done.asset, done.files                                # what `bust.glb` will be, as an asset and as bytes
    done.dropped                                          # -> ("polygons", "groups", ...)

Between .gltf and .glb nothing is lost. What holds little but shape (STL, OFF, 3MF) is written from the parts of the
asset. Colours, normals, materials and textures of OBJ, PLY and glTF go through trimesh; what trimesh cannot read goes
without them, and that is said too.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from o3dmark.errors import BackendError, MeshError
from o3dmark.files.asset import KINDS, Asset
from o3dmark.files.conversion import plain_files, repack
from o3dmark.files.conversion.same_shape import same_shape
from o3dmark.files.conversion.textures import COLOUR, purpose, texture_uses
from o3dmark.files.references import Source

TARGETS = (".ply", ".obj", ".off", ".stl", ".glb", ".gltf", ".3mf")
_PLAIN = {".stl": plain_files.stl, ".off": plain_files.off, ".3mf": plain_files.threemf}
_GLTF = (".glb", ".gltf")
_TEXTURED = (".obj", *_GLTF)


@dataclass(frozen=True)
class Conversion:
    """files: by their names, as `Asset.with_positions` gives them; asset: what they hold; dropped: what it has no more,
    in the order of `KINDS`."""

    files: Mapping[str, bytes]
    asset: Asset
    dropped: tuple[str, ...]


def convert(asset: Asset, path: Path, opened: Callable[[Source], Asset]) -> Conversion:
    """An asset in the format that the ending of ``path`` says, with the same triangles; nothing is written.

    ``opened`` gives the asset that a source holds. Errors: MeshError for an ending that cannot be written, or when a
    texture would not arrive in a format that has textures; BackendError when the triangles do not come out as given.
    """
    suffix = path.suffix.lower()
    if suffix not in TARGETS:
        raise MeshError(f"cannot convert {asset.name} to {path.name}: the ending is none of {', '.join(TARGETS)}")
    if not any(len(part.triangles) for part in asset.parts):
        raise MeshError(f"{asset.name} holds no triangle; only meshes are converted")
    for files in _candidates(asset, suffix, path.stem):
        named = {path.name if name == path.stem + suffix else name: content for name, content in files.items()}
        after = opened(Source(path, named))
        if same_shape(asset, after):
            _check_textures(asset, after)
            return Conversion(named, after, dropped(asset, after))
    raise BackendError(f"{asset.name}: its triangles do not come out as given when it is made a {suffix} file")


def dropped(before: Asset, after: Asset) -> tuple[str, ...]:
    """What is in one asset and not in the other, in the order of `KINDS`, and then of the alphabet."""
    uses = texture_uses(before)
    kept = {purpose(word) for word in texture_uses(after)}
    lost = {f"texture {word}" for word in uses if purpose(word) not in kept} if "textures" in after.contents else set()
    words = (before.contents - after.contents) | lost
    return tuple(sorted(words, key=lambda word: (KINDS.index(word) if word in KINDS else len(KINDS), word)))


def _candidates(asset: Asset, suffix: str, stem: str) -> Iterator[dict[str, bytes]]:
    """The files of a conversion, made with all that can be kept; then, should they be wrong, with the shape alone."""
    before = asset.path.suffix.lower()
    if before in _GLTF and suffix in _GLTF:
        packed = repack.packed(asset.source)
        yield packed.gltf(stem) if suffix == ".gltf" else {f"{stem}.glb": packed.glb()}
        return
    if suffix in _PLAIN:
        yield {stem + suffix: _PLAIN[suffix](asset)}
        return
    from o3dmark.files.conversion import scene, scene_files  # slow to import, and seldom needed

    if before in scene.LOADED:
        try:
            yield scene_files.files(scene.loaded(asset, textures=suffix in _TEXTURED), suffix, stem)
        except (MeshError, MemoryError):
            raise
        except Exception:  # whatever trimesh stumbles over
            pass
    yield scene_files.files(scene.plain(asset), suffix, stem)


def _check_textures(before: Asset, after: Asset) -> None:
    """Errors: MeshError when fewer pictures of colour arrive than there were, in a format that has such."""
    wanted, found = (_colours(asset) for asset in (before, after))
    if after.path.suffix.lower() in _TEXTURED and found < wanted:
        raise MeshError(
            f"{before.name} has {wanted} textures of colour, and {found} would reach {after.name};"
            f" keep the format ({before.path.suffix}), or save the pictures as PNG or JPEG beside it"
        )


def _colours(asset: Asset) -> int:
    return sum(len(pictures) for word, pictures in texture_uses(asset).items() if purpose(word) == COLOUR)
