"""Pictures of files by three.js in Chromium, and how alike two pictures are."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib.image
import numpy as np
import programs
from scipy.ndimage import uniform_filter

from o3dmark.arrays import Floats

SIZE = (300, 400)  # pixels
_WINDOW = 7  # pixels, and the constants: Wang et al., Image quality assessment, 2004
_C1, _C2 = 0.01**2, 0.03**2


@dataclass(frozen=True)
class Likeness:
    """How alike two pictures are: mean absolute difference, from 0 to 1; mean structural similarity, at most 1."""

    difference: float
    similarity: float


def drawn(files: Sequence[Path], times: Sequence[float], folder: Path) -> tuple[list[list[Floats]], str]:
    """For each file its pictures (h, w, 3), 0 to 1, at these seconds of its animation; and what drew them.

    Errors: MissingError, FailedError.
    """
    programs.node("playwright-core")
    versions = f"three {programs.node('three')}"
    seconds = ",".join(map(str, times))
    said = programs.run("node", programs.HERE / "draw.mjs", programs.chromium(), folder, *SIZE, seconds, *files)
    about = json.loads(said)
    paths = [[folder / f"{row}-{column}.png" for column in range(len(times))] for row in range(len(files))]
    pictures = [[np.float64(matplotlib.image.imread(path)[..., :3]) for path in row] for row in paths]
    return pictures, f"{versions}, Chromium {about['browser']}"


def likeness(one: Floats, other: Floats) -> Likeness:
    """Of two pictures (h, w, 3); similarity is that of their grey values where either shows more than background."""
    grey, grey_other = one.mean(axis=2), other.mean(axis=2)
    mean, mean_other = uniform_filter(grey, _WINDOW), uniform_filter(grey_other, _WINDOW)
    variance = uniform_filter(grey**2, _WINDOW) - mean**2
    variance_other = uniform_filter(grey_other**2, _WINDOW) - mean_other**2
    covariance = uniform_filter(grey * grey_other, _WINDOW) - mean * mean_other
    similar = (2 * mean * mean_other + _C1) * (2 * covariance + _C2)
    similar /= (mean**2 + mean_other**2 + _C1) * (variance + variance_other + _C2)
    shown = shows(one) | shows(other)
    return Likeness(float(np.abs(one - other).mean()), float(similar[shown].mean()) if shown.any() else 1.0)


def shows(picture: Floats) -> np.ndarray:
    """True (h, w) where a picture is not white."""
    return (picture < 1.0).any(axis=2)


def side_by_side(pictures: Sequence[Floats], path: Path) -> None:
    """Write pictures of one size as one, from left to right."""
    matplotlib.image.imsave(path, np.concatenate(pictures, axis=1), metadata={"Software": None})
