"""Norm bins of salient vertices: one side of the threshold moves, and the centre is that of the whole mesh."""

import numpy as np
import pytest

from fixtures.shapes import bits_of
from o3dmark.coding.keys import Key
from o3dmark.errors import SpecError
from o3dmark.mesh.saliency import Saliency
from o3dmark.mesh.surface import Surface, TriangleMesh, mesh_arrays
from o3dmark.methods import METHODS
from o3dmark.methods._norm_bins import Bins, vertex_norms
from o3dmark.methods.nakazawa2010 import Nakazawa2010


@pytest.mark.parametrize("side", ["above", "below"])
def test_one_side_of_the_threshold_moves(carrier: TriangleMesh, key: Key, side: str) -> None:
    method = METHODS.make(f"nakazawa2010:side={side},share=0.4")
    moved = (mesh_arrays(method.embed(carrier, bits_of(1), key))[0] != mesh_arrays(carrier)[0]).any(axis=1)
    saliency = Saliency().of_surface(Surface.of(carrier))
    assert 0.35 < moved.mean() < 0.45
    rank = np.argsort(np.argsort(saliency)) / len(saliency)
    wanted = rank >= 0.6 if side == "above" else rank < 0.4
    assert wanted[moved].mean() > 0.85  # the mark itself takes a few across the threshold, which carry bits then


def test_bins_are_those_of_all_norms(carrier: TriangleMesh) -> None:
    """Which of the vertices carry bits does not move the centre, nor the edges of the bins."""
    norms = vertex_norms(Surface.of(carrier).vertices)
    seen = Nakazawa2010(share=0.3).observe(carrier)
    np.testing.assert_array_equal(seen.values, norms)
    np.testing.assert_array_equal(seen.bins(16).edges, Bins.equal_width(norms, 16).edges)
    assert (seen.bins(16).of[~seen.used] == -1).all()


def test_misuse_is_an_error() -> None:
    for spec in ("nakazawa2010:share=0", "nakazawa2010:side=left"):
        with pytest.raises(SpecError):
            METHODS.make(spec)
