"""Profiles: what an owner and a reader share beside the key, under a dated name.

A profile, once published, is never edited, so that old marks stay readable; golden marks in the tests hold it to that.
"""

from collections.abc import Iterator, Mapping
from functools import cache

from o3dmark.coding.payload import CODES
from o3dmark.errors import SpecError
from o3dmark.methods import METHODS
from o3dmark.registry import nearest
from o3dmark.watermark import Watermark

_SPECS = {  # method, code, bits between them
    "robust-2026": ("shape-spectrum", "random", 64),
    "invisible-2026": ("shape-spectrum:mrms=0.00037", "random", 64),
    "slender-2026": ("shape-spectrum:lowest=8,highest=24,rungs=60", "random", 64),
    "paper-2026": ("saliency-scs", "random", 64),
    "contested-2026": ("shape-spectrum:mrms=0.0004,lowest=8,highest=24,rungs=60", "random", 64),
    "layered-2026": ("layered", "random", 64),
    "tiny-2026": ("saliency-scs", "random:message_bytes=1", 32),
}
DEFAULT_PROFILE = "layered-2026"
_LAYERS = {"robust-2026": "layered-2026"}  # profiles that are a layer of another: of one method, code and length


class _UnknownProfileError(SpecError, KeyError):
    """As a mapping has it."""

    __str__ = SpecError.__str__  # a KeyError's puts it in quotes


class _Profiles(Mapping[str, Watermark]):
    """Watermarks by name, each made when it is first asked for: a method may take long to import."""

    def __getitem__(self, name: str) -> Watermark:
        """Errors: SpecError, which is a KeyError here, with the profile that was meant, or all there are."""
        if name not in _SPECS:
            raise _UnknownProfileError(f"no profile is called {name!r}{nearest(str(name), list(_SPECS))}")
        return _made(*_SPECS[name])

    def __iter__(self) -> Iterator[str]:
        return iter(_SPECS)

    def __len__(self) -> int:
        return len(_SPECS)

    def __contains__(self, name: object) -> bool:
        return name in _SPECS


@cache
def _made(method: str, code: str, n_bits: int) -> Watermark:
    return Watermark(METHODS.make(method), CODES.make(code), n_bits)


PROFILES: Mapping[str, Watermark] = _Profiles()


def separate() -> list[str]:
    """The profiles but for those that are a layer of another, the default first.

    Such a one holds no message that the other does not, and the other reads its marks.
    """
    return sorted((name for name in PROFILES if name not in _LAYERS), key=lambda name: name != DEFAULT_PROFILE)
