"""Where the picture is taken from, and at which distance the whole mesh fills it."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from o3dmark.arrays import Floats

FIELD_OF_VIEW = 24.0  # degrees, along the shorter side of the picture: a long lens, which distorts little
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
    up: Literal["x", "y", "z"] = "y"

    def __post_init__(self) -> None:
        if not (np.isfinite([self.azimuth, self.elevation, self.zoom]).all() and self.zoom > 0):
            raise ValueError(f"a camera needs finite angles and a positive zoom, not {self}")
        if self.up not in ("x", "y", "z"):
            raise ValueError(f"up should be x, y or z, not {self.up!r}")

    @property
    def axes(self) -> Floats:
        """Rows (3, 3): the picture's right, its up, and the direction from the mesh to the eye."""
        a, e = np.radians([self.azimuth, self.elevation])
        right = np.array([np.cos(a), 0.0, -np.sin(a)])
        back = np.array([np.sin(a) * np.cos(e), np.sin(e), np.cos(a) * np.cos(e)])
        x, y, z = np.eye(3)
        world = {"x": (y, x, -z), "y": (x, y, z), "z": (x, z, -y)}[self.up]
        return np.asarray(np.stack([right, np.cross(back, right), back]) @ np.stack(world))

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
