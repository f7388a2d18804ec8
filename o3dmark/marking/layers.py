"""Which layers of a mark are in an asset: each is read by itself, at first sight, as if the others were lost."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from o3dmark.coding.keys import Key
from o3dmark.marking.embedding import Marked
from o3dmark.mesh.surface import MeshArrays
from o3dmark.watermark import Watermark


@dataclass(frozen=True)
class LayerRead:
    """A layer in a part of an asset: whether the message is read from it alone, and in which ``place`` of the part."""

    part: str
    layer: str
    read: bool
    place: str = ""

    @property
    def words(self) -> str:
        """The same as a line for people."""
        where = f" ({self.place})" if self.place else ""
        return f"{self.part}, {self.layer}: {'read' if self.read else 'not there'}{where}"


def layers_read(marked: Marked, watermark: Watermark, message: str | ArrayLike, key: Key) -> list[LayerRead]:
    """Of each marked part every layer; none for methods that have no layers."""
    found = []
    for number, vertices in marked.moved.items():
        part = marked.asset.parts[number]
        for name, method in watermark.method.layers.items():
            alone = replace(watermark, method=method.quick)
            extraction = alone.extract_bits(MeshArrays(vertices, part.triangles), key)
            if isinstance(message, str):
                read = alone.decode(extraction, key).message == message
            else:
                known = extraction.soft != 0.0
                read = bool(known.any() and (extraction.bits == np.asarray(message))[known].all())
            found.append(LayerRead(part.name, name, read, extraction.part if read else ""))
    return found
