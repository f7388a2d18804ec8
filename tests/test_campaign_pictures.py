"""What a campaign draws and keeps, and where it measures the saliency of attacked meshes."""

import json
from pathlib import Path

import pytest

from fixtures.small_campaign import TOML, campaign
from o3dmark.campaign import Row, read_rows, run
from o3dmark.campaign.pictures import Picture, save_pictures
from o3dmark.campaign.saliency_rank import rank_correlation
from o3dmark.campaign.specimen import Specimen
from o3dmark.mesh.saliency import Saliency

pytestmark = pytest.mark.usefixtures("own_registries")
TEXT = (
    TOML.replace('"ring.ply"', '"ring.ply"\nAgain = "ring.ply"\nUnseen = "ring.ply"').replace("wrong_keys", "unmarked")
    + """
[attacks.refused]
"all" = ["crop:share=0.99", "crop:share=0.99", "crop:share=0.99"]
[gallery]
meshes = ["Again", "Ring"]
attacks = ["noise/0.05%", "refused/all"]
subject = "Ring"
"""
)


@pytest.fixture(scope="module")
def folder(own_registries: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a campaign with a gallery."""
    folder = tmp_path_factory.mktemp("gallery")
    list(run(campaign(folder, TEXT), folder / "out"))
    return folder / "out"


def test_the_gallery_is_kept_as_jpegs_with_a_list(folder: Path) -> None:
    entries = json.loads((folder / "pictures.json").read_text())
    assert [(entry["mesh"], entry["kind"], entry["group"], entry["condition"]) for entry in entries] == [
        ("Ring", "saliency", "no attack", "-"),
        ("Ring", "original", "no attack", "-"),
        ("Ring", "marked", "no attack", "-"),
        ("Ring", "attacked saliency", "no attack", "-"),
        ("Ring", "attacked", "noise", "0.05%"),
        ("Ring", "attacked saliency", "noise", "0.05%"),
        ("Again", "saliency", "no attack", "-"),
        ("Again", "original", "no attack", "-"),
        ("Again", "marked", "no attack", "-"),
    ]
    assert entries[0]["caption"] == "900 vertices"
    contents = [(folder / entry["file"]).read_bytes() for entry in entries]
    assert all(content[:2] == b"\xff\xd8" for content in contents)
    assert contents[:2] == contents[6:8], "equal meshes look alike"
    assert len({contents[k] for k in (0, 1, 4, 5)}) == 4
    assert {path.name for path in (folder / "pictures").iterdir()} == {Path(entry["file"]).name for entry in entries}


def test_saliency_is_compared_where_it_is_drawn(folder: Path) -> None:
    measured = [row for row in read_rows(folder) if row.saliency_rank is not None]
    assert {(row.mesh, row.label, row.seed, row.group, row.control) for row in measured} == {
        (mesh, "one", 0, group, "") for mesh in ("Ring", "Again") for group in ("no attack", "noise")
    }
    assert all(0.5 < (row.saliency_rank or 0) <= 1 for row in measured)


def test_saliency_is_compared_everywhere_where_the_campaign_asks(tmp_path: Path) -> None:
    plan = campaign(tmp_path, "saliency_rank = true\n" + TOML)
    list(run(plan, tmp_path / "out"))
    rows = list(read_rows(tmp_path / "out"))
    assert all((row.saliency_rank is not None) == (row.control == "") for row in rows)
    job = next(plan.jobs())
    made, case = Specimen.of(job), job.cases[1]
    mesh = made.attacked(case)
    expected = rank_correlation(made.cover, Saliency()(made.cover), mesh, Saliency()(mesh))
    row = next(row for row in rows if (row.job, row.group) == (job.id, "cropping"))
    assert row.saliency_rank == pytest.approx(expected, rel=1e-5)
    assert not (tmp_path / "out" / "pictures.json").exists()


def test_a_picture_that_fails_is_told_of(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> None:
        raise RuntimeError("no light")

    monkeypatch.setattr("o3dmark.campaign.pictures.render", fail)
    plan = campaign(tmp_path, TEXT)
    list(run(plan, tmp_path / "out"))
    rows: list[Row] = [row for row in read_rows(tmp_path / "out") if row.saliency_failure]
    assert {row.saliency_failure for row in rows} == {"RuntimeError: no light"}
    assert {row.failure for row in rows} == {None}


def test_pictures_are_replaced_and_never_leave_the_folder(tmp_path: Path) -> None:
    for content in (b"first", b"second"):
        save_pictures(tmp_path, [Picture("../../B:", "marked", "a/b", "5 %", "", content)], ["A"])
    alike = [Picture("A", "marked", group, "5 %", "", group.encode()) for group in ("a/b", "a b")]
    save_pictures(tmp_path, alike, ["A"])
    entries = json.loads((tmp_path / "pictures.json").read_text())
    assert [entry["mesh"] for entry in entries] == ["A", "A", "../../B:"]
    assert [(tmp_path / entry["file"]).read_bytes() for entry in entries] == [b"a/b", b"a b", b"second"]
    assert {(tmp_path / entry["file"]).parent for entry in entries} == {tmp_path / "pictures"}
