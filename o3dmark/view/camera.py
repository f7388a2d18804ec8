"""Where the picture is taken from, and at which distance the whole mesh fills it."""

from dataclasses import dataclass
from typing import Literal, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from o3dmark.arrays import Floats
from o3dmark.errors import SpecError

Up: TypeAlias = Literal["x", "y", "z"]

FIELD_OF_VIEW = 24.0  # degrees, along the shorter side of the picture: a long lens, which distorts little
SIDES = {  # azimuth and elevation, in degrees
    "front": (0.0, 0.0),
    "right": (90.0, 0.0),
    "back": (180.0, 0.0),
    "left": (-90.0, 0.0),
    "top": (0.0, 90.0),
    "bottom": (0.0, -90.0),
}
MARGIN = 0.05  # left empty on each side, over the side's length


@dataclass(frozen=True)
class Camera:
    """A direction to look from; the distance follows from the mesh, which fills the picture at zoom 1.

    azimuth, elevation: degrees; (0, 0) looks at the front (from +z where y is up, from -y where z is up), and growing
    azimuth takes the viewer to the right. zoom: magnification about the picture's centre. up: the axis that is up.
    """

    azimuth: float = -32.0
    elevation: float = 18.0
    zoom: float = 1.0
    up: Up = "y"

    def __post_init__(self) -> None:
        if not (np.isfinite([self.azimuth, self.elevation, self.zoom]).all() and self.zoom > 0):
            raise ValueError(f"a camera needs finite angles and a positive zoom, not {self}")
        if self.up not in ("x", "y", "z"):
            raise ValueError(f"up should be x, y or z, not {self.up!r}")

    @classmethod
    def parse(cls, text: str) -> "Camera":
        """A side by its name, or azimuth and elevation, then the axis that is up unless y: "left", "30,-10", "top,z".

        Errors: SpecError, which says what would do.
        """
        words = [word.strip() for word in text.split(",")]
        up = words.pop() if words[-1] in ("x", "y", "z") else "y"
        try:
            azimuth, elevation = SIDES.get(",".join(words)) or map(float, words)
            return cls(azimuth, elevation, up=cast(Up, up))
        except ValueError:
            raise SpecError(
                f"a camera is {', '.join(SIDES)} or AZIMUTH,ELEVATION in degrees, and may end in ,x or ,z for the axis"
                f" that is up; not {text!r}"
            ) from None

    @property
    def world(self) -> Floats:
        """Rows (3, 3): what is right, up and to the front of a mesh whose ``up`` axis is up, in its own axes."""
        x, y, z = np.eye(3)
        return np.stack({"x": (y, x, -z), "y": (x, y, z), "z": (x, z, -y)}[self.up])

    @property
    def axes(self) -> Floats:
        """Rows (3, 3): the picture's right, its up, and the direction from the mesh to the eye."""
        a, e = np.radians([self.azimuth, self.elevation])
        right = np.array([np.cos(a), 0.0, -np.sin(a)])
        back = np.array([np.sin(a) * np.cos(e), np.sin(e), np.cos(a) * np.cos(e)])
        return np.asarray(np.stack([right, np.cross(back, right), back]) @ self.world)

    def rays(self, points: Floats, width: int, height: int) -> NDArray[np.float32]:
        """Rays (height, width, 6), origin and unit direction, such that ``points`` (n, 3) just fit in the picture.

        Points and rays are in the camera's axes. With t the tangent of half the field of view, a point is inside when
        ``|x - eye_x| <= t (eye_z - z)``; the nearest eye that keeps all of them inside follows from two maxima.
        """
        tangent = np.tan(np.radians(FIELD_OF_VIEW / 2)) * np.array([width, height]) / min(width, height)
        inner = tangent * (1 - 2 * MARGIN)
        right = (points[:, :2] + inner * points[:, 2:]).max(axis=0)
        left = (-points[:, :2] + inner * points[:, 2:]).max(axis=0)
        eye = np.append((right - left) / 2, ((right + left) / (2 * inner)).max())
        tangent = tangent / self.zoom
        x = tangent[0] * ((np.arange(width) + 0.5) * 2 / width - 1)
        y = tangent[1] * (1 - (np.arange(height) + 0.5) * 2 / height)
        rays = np.empty((height, width, 6), np.float32)
        rays[..., :3] = eye
        rays[..., 3:] = np.stack(np.broadcast_arrays(x, y[:, None], -1.0), axis=-1)
        rays[..., 3:] /= np.linalg.norm(rays[..., 3:], axis=-1, keepdims=True)
        return rays


THREE_QUARTER = Camera()
