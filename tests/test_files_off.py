"""OFF files of every layout: nothing is misread, and what cannot be read says so."""

import numpy as np
import pytest

from fixtures.files import CORNERS, assert_refused
from o3dmark.files import read_mesh
from o3dmark.mesh.surface import Surface


@pytest.mark.parametrize(
    "text",
    [
        f"OFF\n4 2 0\n{CORNERS}3 0 1 2\n3 0 2 3\n",
        f"OFF\n# a square\n4 2 0 # counts\n{CORNERS}3 0 1 2\n3 0 2 3\n",
        f"OFF\r\n4 1 0\r\n{CORNERS}4 0 1 2 3\r\n",
        f"OFF 4 2 0\n{CORNERS}3 0 1 2\n3 0 2 3\n",
        f"OFF4 2 0\n{CORNERS}3 0 1 2\n3 0 2 3\n",
        f"\n# a square\n  off # so\n\n4\n2\n{CORNERS}3 0 1 2\n3 0 2 3\n",
        f"OFF\n4 2 0\n{CORNERS}3 0 1 2 1 0 0 # red\n# the other\n3 0 2 3 7\n",
        f"OFF\n4 4 0\n{CORNERS}3 0 1 2\n2 0 2\n1 3\n3 0 2 3\n",
    ],
    ids=["plain", "comments", "quad", "one line", "glued", "loose", "coloured faces", "lines and points"],
)
def test_off(write, text):
    assert Surface.of(read_mesh(write("a.off", text))).area == 1.0


@pytest.mark.parametrize(
    ("kind", "columns"),
    [
        ("COFF", "0.2 0.4 1"),
        ("COFF", "0.2 0.4 1 0.5"),
        ("coff", "51 102 255 128"),
        ("CNOFF", "0 0 1 51 102 255"),
        ("NOFF", "0 0 1"),
        ("STCNOFF", "0 0 1 0.2 0.4 1 1 0.7 0.7"),
    ],
)
def test_off_vertices_may_have_normals_and_colours(write, kind, columns):
    vertices = "".join(f"{row} {columns}\n" for row in CORNERS.splitlines())
    mesh = read_mesh(write("a.off", f"{kind}\n4 1 0\n{vertices}4 0 1 2 3\n"))
    assert Surface.of(mesh).area == 1.0
    assert mesh.has_vertex_colors() == ("C" in kind.upper())
    assert mesh.has_vertex_normals() == ("N" in kind.upper())
    assert np.allclose(mesh.vertex_colors, [0.2, 0.4, 1.0])
    assert np.allclose(mesh.vertex_normals, [0.0, 0.0, 1.0])


@pytest.mark.parametrize(
    ("vertices", "face", "words"),
    [
        (CORNERS, "4 0 1 2", "number of corners"),
        (CORNERS, "x 0 1 2", "number of corners"),
        (CORNERS, "3 0 1 4", "4 vertices"),
        (CORNERS, "3 0 1 -1", "4 vertices"),
        (CORNERS, f"3 0 1 {2**70}", "4 vertices"),
        (CORNERS.replace("1", "one"), "3 0 1 2", "not 3 numbers"),
        (CORNERS.replace(" 0\n", "\n"), "3 0 1 2", "not 3 numbers"),
        (CORNERS, "2 0 1", "no triangle"),
        (f"{CORNERS}# so", "", "0 can be read"),
    ],
)
def test_bad_off(write, vertices, face, words):
    assert_refused(write("a.off", f"OFF\n4 1 0\n{vertices}{face}\n"), words)


@pytest.mark.parametrize("kind", ["OFF", "CNOFF"])
def test_an_empty_off(write, kind):
    assert_refused(write("a.off", f"{kind}\n0 0 0\n"), "holds no mesh")


def test_a_coloured_off_without_colours_is_refused(write):
    assert_refused(write("a.off", f"COFF\n4 1 0\n{CORNERS}3 0 1 2\n"), "not 6 numbers")


@pytest.mark.parametrize("counts", ["4 3", "5 2", "99999999999 2", "2000000000 2", "4 2000000000"])
def test_off_counts_must_be_met(write, counts):
    assert_refused(write("a.off", f"OFF\n{counts} 0\n{CORNERS}3 0 1 2\n3 0 2 3\n"))


@pytest.mark.parametrize("text", ["hello there friend\n", "OFF\n", "OFF\nfour two 0\n", "OFF\n-4 2 0\n"])
def test_what_is_no_off(write, text):
    assert_refused(write("a.off", text), "does not begin like an OFF file")
