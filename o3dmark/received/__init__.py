"""What a received surface may be taken for: as it came, torn and welded again, one piece of it, what is seen of it.

    as received     welded as the writer welds (`mesh.welding.mended`), turned outward, closed by fans
    as wound        the triangles as they are: no turning, no fans; nothing at all is asked of a soup, or of cracks
    welded          within ever larger tolerances
    outermost       without the pieces that lie within others; and without those that are small
    a piece alone   the largest few
    seen            without the triangles that nobody sees from outside

A closed surface in one piece, all of it seen, has the first view alone, and costs no more than it did.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from o3dmark.arrays import Bools, Ints
from o3dmark.errors import MeshError
from o3dmark.mesh import geometry
from o3dmark.mesh.inside import pieces, seen, within
from o3dmark.mesh.surface import Surface
from o3dmark.mesh.welding import ladder, mended_by, open_edges

MOST = 24  # views
_MOST_PIECES = 64  # of which it is asked whether they are within others: the largest
_MOST_ALONE = 12  # pieces looked at alone: a scene of ten objects, a print plate
_LARGE = 1e-3  # of the area: an outermost piece that counts
_ALONE = 0.02  # of the area: a piece that is looked at alone
_FEWEST = 200  # triangles: fewer hold no message
_UNSEEN = 1e-3  # of the area: less that nobody sees is left where it is


@dataclass(frozen=True, eq=False)
class View:
    """A surface to look for a mark in; ``name`` says what it is of the one received, empty for all of it.

    ``thorough``: whether a long search in it is worth while. It is, in the view as received and in the one that looks
    most like the object by itself.
    """

    name: str
    surface: Surface
    thorough: bool = False


def views(received: Surface) -> Iterator[View]:
    """What to look at, the likeliest first, at most `MOST`; each is worked out when it is asked for."""
    return islice(_views(received), MOST)


def _views(received: Surface) -> Iterator[View]:
    welds = ladder(received)
    whole = mended_by(received, welds)
    yield View("", whole, thorough=True)
    if open_edges(whole) or not _wound_alike(whole):
        yield View("as wound", replace(received, as_wound=True))
    for number, surface in enumerate(welds if open_edges(whole) else [], start=1):
        if len(surface.vertices) != len(whole.vertices):
            yield View(f"welded {number}", surface)
    piece = pieces(whole)
    outer = _outermost(whole, piece)
    if len(outer) > 1:
        yield from _parts(whole, piece, outer)
    visible = seen(whole)
    hidden = ~visible & outer[piece]
    if geometry.areas(whole.vertices, whole.triangles[hidden]).sum() > _UNSEEN * whole.area:
        yield from _of(whole, visible, "what is seen")


def _outermost(whole: Surface, piece: Ints) -> Bools:
    """Which pieces are not within others, as far as that is asked."""
    outer = np.ones(int(piece.max()) + 1, bool)
    count = min(len(outer), _MOST_PIECES)
    if count > 1:
        outer[:count] = ~within(whole, piece, count)
    return outer


def _parts(whole: Surface, piece: Ints, outer: Bools) -> Iterator[View]:
    """The outermost pieces together, and the largest pieces, each alone."""
    areas = np.bincount(piece, geometry.areas(whole.vertices, whole.triangles))
    large = outer & (areas > _LARGE * whole.area)
    if not outer.all():
        yield from _of(whole, outer[piece], "outermost", thorough=bool((outer == large).all()))
    if not np.array_equal(outer, large):
        yield from _of(whole, large[piece], "outermost and large", thorough=True)
    for number in range(min(len(areas), _MOST_ALONE)):
        if areas[number] > _ALONE * whole.area and np.count_nonzero(piece == number) >= _FEWEST:
            if np.array_equal(large, np.arange(len(areas)) == number):
                continue  # seen already
            yield from _of(whole, piece == number, f"piece {number + 1}, by area")


def _of(whole: Surface, triangles: Bools, name: str, *, thorough: bool = False) -> Iterator[View]:
    """A view of some triangles (m,), if they are a surface at all."""
    try:
        yield View(name, whole.part(triangles), thorough)
    except MeshError:
        return


def _wound_alike(surface: Surface) -> bool:
    """Whether no edge is used twice in the same direction."""
    start, end = surface.triangles.ravel(), np.roll(surface.triangles, -1, axis=1).ravel()
    return len(np.unique(start * len(surface.vertices) + end)) == len(start)
