"""Marking where nobody says with which profile: the default, or else the first that holds the message on this asset."""

from collections.abc import Mapping
from typing import NamedTuple

from o3dmark.coding.keys import Key
from o3dmark.errors import ConversionError, MeshError, O3dmarkError, SpecError
from o3dmark.files import Asset
from o3dmark.marking.embedding import Marked, embed
from o3dmark.profiles import PROFILES, separate


class Chosen(NamedTuple):
    """A marked asset, the name of its profile, and why others, tried before, did not do."""

    marked: Marked
    profile: str
    refused: Mapping[str, str]


def embed_by_any(
    asset: Asset, message: str, key: Key, *, name: str | None = None, names: Mapping[str, str] | None = None
) -> Chosen:
    """As `embed`, which has the same arguments, under the default profile or the first of the others that works.

    What comes back was read from what will be written. Errors: when none works, that of the default, with what each
    said; ConversionError, whatever the profile.
    """
    refused: dict[str, str] = {}
    first: O3dmarkError | None = None
    for profile in separate():
        try:
            marked = embed(asset, PROFILES[profile], message, key, name=name, names=names)
        except ConversionError:
            raise
        except (SpecError, MeshError) as error:
            first = first or error
            refused[profile] = str(error)
        else:
            if marked.verified:
                return Chosen(marked, profile, refused)
            refused[profile] = "; ".join(dict.fromkeys(each.why for each in marked.left))
    told = "; ".join(f"{name}: {why}" for name, why in refused.items())
    if first is None:
        raise MeshError(f"no profile does: {told}")
    if len(set(refused.values())) > 1:
        first.args = (f"no profile does: {told}",)
    raise first
