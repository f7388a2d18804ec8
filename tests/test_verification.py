"""What was embedded is read back: a mark that cannot be read is never handed out as one."""

import json
from pathlib import Path

import numpy as np
import pytest

from fixtures.shapes import bits_of, icosphere
from o3dmark.cli import main
from o3dmark.coding.keys import Key
from o3dmark.errors import MeshError
from o3dmark.files import write_mesh
from o3dmark.mesh.surface import TriangleMesh, triangle_mesh
from o3dmark.methods import METHODS, Extraction
from o3dmark.methods.shape_spectrum.decoder import Decoder
from o3dmark.methods.shape_spectrum.method import ShapeSpectrum


def ellipsoid(levels: int) -> TriangleMesh:
    vertices, triangles = icosphere(levels)
    return triangle_mesh(vertices * [1.0, 1.4, 1.9], triangles)


@pytest.mark.parametrize("secret", [1, 2])
def test_of_the_ways_to_write_one_is_taken_that_can_be_read(secret: int) -> None:
    """Of an ellipsoid's frames the mark itself decides which comes first, and a reader that does not search takes it.

    With these keys the least motion writes into another frame than it brings about: eight bits of 16 would be wrong.
    """
    method = ShapeSpectrum(mrms=2e-3, search=False, motion="least")
    key, bits = Key(bytes([secret] * 32)), bits_of(secret)
    assert np.array_equal(method.extract(method.embed(ellipsoid(3), bits, key), 16, key).bits, bits)


def test_a_mesh_is_refused_when_nothing_that_was_written_can_be_read(key: Key, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Decoder, "read", lambda *_: Extraction(np.zeros(16)))
    with pytest.raises(MeshError, match="read back"):
        ShapeSpectrum(mrms=2e-3).embed(ellipsoid(2), np.ones(16, int), key)


@pytest.mark.parametrize("name", list(METHODS))
def test_the_command_keeps_no_file_that_cannot_be_read(
    name: str,
    spot: TriangleMesh,
    semi_regular: TriangleMesh,
    key: Key,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Whatever the method: its reader, struck blind here, decides what is kept, and an older file is left alone."""
    key.save(tmp_path / "owner.key")
    write_mesh(tmp_path / "cover.ply", semi_regular if METHODS[name].needs_semi_regular else spot)
    (tmp_path / "out.ply").write_text("older")
    monkeypatch.setattr(type(METHODS.make(name)), "extract", lambda *_, **__: Extraction(np.zeros(16)))
    words = ["embed", tmp_path / "cover.ply", tmp_path / "out.ply", "--key", tmp_path / "owner.key", "--method", name]
    with pytest.raises(SystemExit) as leave:
        main([*map(str, words), "--bits", "0110100110010110", "--overwrite", "--json"])
    report = json.loads(capsys.readouterr().out)
    assert (leave.value.code, report["verified"], report["output"]) == (1, False, None)
    assert (tmp_path / "out.ply").read_text() == "older"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cover.ply", "out.ply", "owner.key"]
