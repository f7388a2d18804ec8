"""One mesh or point cloud of a page: where it is, what colours it, and how the page's script is told."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from o3dmark.arrays import Floats
from o3dmark.errors import MeshError
from o3dmark.mesh.proximity import closest_points
from o3dmark.mesh.similarity import UnitSize
from o3dmark.mesh.surface import Surface, mesh_arrays
from o3dmark.view.colours import SALIENCY, beyond, checked_scalars, colour_limits
from o3dmark.view.displacement import DISPLACEMENT, Displacement, agree, distance_from, from_zero
from o3dmark.view.model import Shape, cloud_normals, n_vertices, positions, shape_of, splat_radius
from o3dmark.view.page.buffers import Buffers
from o3dmark.view.page.corners import Corners
from o3dmark.view.render import jpeg
from o3dmark.view.texture import Texture
from o3dmark.view.worn import has_texture, vertex_colours

PICTURE_QUALITY = 92  # of the JPEG that a texture becomes
COVERING = 2.0  # times as large as points are apart they cover a surface that was sampled at random, nearly
NEAR = 0.25  # of the diagonal: how far the centres of boxes may be apart, of half to twice the size, in one frame


class Shown(NamedTuple):
    """A mesh or point cloud under a name; saliency (n,), one number a vertex, if it is to be shown; a caption."""

    name: str
    mesh: Any
    saliency: ArrayLike | None = None
    caption: str = ""


class Quantity(NamedTuple):
    """Numbers (n,) of a mesh's vertices to be shown as colours: ``label`` names them and their unit."""

    label: str
    values: Floats
    limits: tuple[float, float]

    def told(self, buffers: Buffers) -> dict[str, Any]:
        return {
            "label": self.label,
            "values": buffers.array(self.values, "float32"),
            "limits": self.limits,
            "beyond": beyond(self.values, self.limits),
        }


@dataclass(frozen=True, eq=False)
class Drawn:
    """A mesh that is shown beside the ``first`` of a page, or is that (None); errors as of `Texture.of`."""

    shown: Shown
    first: "Drawn | None" = None

    @cached_property
    def shape(self) -> Shape:
        if isinstance(self.shown.mesh, Surface):
            raise MeshError("a page shows Open3D's meshes and point clouds, whose vertices are all there")
        return shape_of(self.shown.mesh)

    @cached_property
    def points(self) -> Floats:
        """All vertices or points (n, 3), as they are given."""
        return mesh_arrays(self.shown.mesh)[0] if isinstance(self.shape, Surface) else positions(self.shape)

    @cached_property
    def moved(self) -> Displacement | None:
        """From the first mesh, where the triangles are the same."""
        if self.first is None or not (isinstance(self.shape, Surface) and isinstance(self.first.shape, Surface)):
            return None
        one, other = self.first.shown.mesh, self.shown.mesh
        return Displacement.of(one, other) if agree(one, other) else None

    @cached_property
    def unit(self) -> UnitSize:
        """The first one's centre and diagonal for what is its own or lies beside it, else the shape's own."""
        own = UnitSize.about_box(positions(self.shape))
        own = own if own.size else own._replace(size=1.0)  # a single point
        if self.first is None:
            return own
        shared = self.first.unit
        near = np.linalg.norm(own.centre - shared.centre) <= NEAR * shared.size
        return shared if self.moved or (near and shared.size / 2 <= own.size <= shared.size * 2) else own

    @cached_property
    def texture(self) -> Texture | None:
        wears = isinstance(self.shape, Surface) and has_texture(self.shown.mesh)
        return Texture.of(self.shown.mesh, self.shape) if wears else None

    @cached_property
    def corners(self) -> Corners | None:
        """None for a cloud. With the first one's triangles and texture also its creases: both are shaded alike."""
        if not isinstance(self.shape, Surface):
            return None
        own = Corners.of(self.shown.mesh, self.shape, self.texture)
        if self.moved is None or self.first is None or self.first.corners is None:
            return own
        theirs = self.first.corners
        same = own.counts == theirs.counts and np.array_equal(own.places(), theirs.places())
        return theirs if same else own

    @cached_property
    def quantities(self) -> dict[str, Quantity]:
        """What can be shown of it as colours, by the names of `content.RAMPS`."""
        found = {}
        if self.moved is not None:
            found["displacement"] = Quantity(DISPLACEMENT, *_lengths(self.moved.lengths))
        elif self.first is not None and self.unit is self.first.unit and isinstance(self.first.shape, Surface):
            far = 100.0 * closest_points(self.points, self.first.shape).distance / self.first.shape.diagonal
            found["displacement"] = Quantity(distance_from(self.first.shown.name), *_lengths(far))
        if self.shown.saliency is not None:
            values = checked_scalars(self.shown.saliency, n_vertices(self.shape))
            found["saliency"] = Quantity(SALIENCY, values, colour_limits(values))
        return found

    @property
    def rounding(self) -> float:
        """By how much float32 rounds its positions, over the diagonal; 0 where displacements are kept."""
        there = self.unit.apply(self.points)
        return 0.0 if self.moved is not None else float(np.abs(there.astype(np.float32) - there).max())

    def told(self, buffers: Buffers) -> dict[str, Any]:
        """It for the script, in the page's unit. Positions that are displacements are told as such."""
        by = self.unit.apply(self.points) if self.moved is None else self.moved.by / self.unit.size
        colours, corners = vertex_colours(self.shown.mesh), self.corners
        return {
            "name": self.shown.name,
            "caption": self.shown.caption or self._counts(),
            "moved": self.moved is not None,
            "positions": buffers.array(by, "float32"),
            "colours": None if colours is None else buffers.array(_bytes(colours), "uint8"),
            "quantities": {name: quantity.told(buffers) for name, quantity in self.quantities.items()},
            "surface": None if corners is None else self._surface(corners, buffers),
            "cloud": self._cloud(buffers) if corners is None else None,
        }

    def _surface(self, corners: Corners, buffers: Buffers) -> dict[str, Any]:
        pictures = [] if self.texture is None else self.texture.pictures
        return {
            "triangles": buffers.array(corners.triangles, "uint32"),
            "point": buffers.array(corners.point, "uint32"),
            "group": buffers.array(corners.group, "uint32"),
            "uv": None if corners.uv is None else buffers.array(corners.uv, "float32"),
            "counts": corners.counts,
            "pictures": [buffers.bytes(jpeg(_bytes(picture), PICTURE_QUALITY)) for picture in pictures],
        }

    def _cloud(self, buffers: Buffers) -> dict[str, Any]:
        shape: Any = self.shape
        radius = COVERING * splat_radius(self.unit.apply(self.points))
        return {"normals": buffers.array(cloud_normals(shape), "float32"), "radius": radius}

    def _counts(self) -> str:
        if not isinstance(self.shape, Surface):
            return f"{len(self.points):,} points"
        own = "" if self.first is None or self.unit is self.first.unit else ", in a place and size of its own"
        return f"{len(self.points):,} vertices, {len(self.shape.triangles):,} triangles{own}"


def _lengths(values: Floats) -> tuple[Floats, tuple[float, float]]:
    return values, from_zero(values)


def _bytes(colours: Floats) -> Any:
    """Colours of 0 to 1 as bytes."""
    rgb = np.broadcast_to(colours[..., :3], (*colours.shape[:-1], 3))  # a grey picture has one channel
    return np.round(255.0 * rgb.clip(0.0, 1.0)).astype(np.uint8)
