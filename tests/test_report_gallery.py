"""Pictures are those that the folder keeps; what stands below them is from the rows."""

import base64
import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

from fixtures.kept_folder import PLAIN, invented_rows, keep
from o3dmark.campaign.row import Row
from o3dmark.errors import SpecError
from o3dmark.report import write_report

JPEG = b"\xff\xd8\xff\xe0 a picture"
NONE = "This folder keeps no pictures."


def ranked(row: Row) -> Row:
    """The rank correlation of the gallery's readings: 0.25 for the unattacked, 0.5 after attacks, none of loop."""
    if row.label != PLAIN.main or row.control or row.mesh == "Bunny" or row.seed:
        return row
    if row.condition == "loop":
        return replace(row, saliency_failure="MeshError: no saliency")
    return replace(row, saliency_rank=0.25 if row.condition == "-" else 0.5)


def kept(folder: Path) -> Path:
    """A folder with pictures of two meshes, the subject among them."""
    keep(folder, PLAIN, invented_rows(PLAIN, ranked))
    entries = [("Bimba", "saliency", "", ""), ("Vase", "saliency", "", "")]
    entries += [("Vase", "original", "", ""), ("Vase", "marked", "no attack", "-")]
    entries += [(mesh, "attacked", "noise", "0.50%") for mesh in ("Vase", "Bimba")]
    entries += [("Vase", "attacked saliency", *case) for case in (("no attack", "-"), ("noise", "0.50%"))]
    (folder / "pictures").mkdir()
    lines = []
    for count, (mesh, kind, group, condition) in enumerate(entries):
        (folder / "pictures" / f"{count}.jpg").write_bytes(JPEG + bytes([count]))
        line = {"mesh": mesh, "kind": kind, "group": group, "condition": condition, "caption": f"number {count}"}
        lines.append({"file": f"pictures/{count}.jpg"} | line)
    (folder / "pictures.json").write_text(json.dumps(lines))
    return folder


def test_pictures_of_the_folder_are_in_the_page_with_what_the_rows_say(tmp_path: Path) -> None:
    _, path = write_report(kept(tmp_path))
    page = path.read_text()
    data = [base64.b64decode(found) for found in re.findall(r'src="data:image/jpeg;base64,([^"]+)"', page)]
    assert [picture[-1] for picture in data] == [0, 1, 2, 3, 4, 1, 6, 7]  # not the one of Bimba after an attack
    assert all(picture.startswith(JPEG) for picture in data)
    assert "<h2>Vase after attacks</h2>" in page
    marked, attacked = (
        next(row for row in invented_rows(PLAIN) if (row.label, row.mesh, row.seed, row.condition) == wanted)
        for wanted in (("second", "Vase", 0, "-"), ("second", "Vase", 0, "0.50%"))
    )
    mrms = f"MRMS {1e3 * (marked.metrics['mrms'] or 0):.2f} · 10⁻³"
    assert f"<small>{mrms}, Corr {marked.corr:.2f}, number 3</small>" in page
    message = ", message read" if attacked.message_ok else ""
    assert f"<small>Corr {attacked.corr:.2f}{message}, number 4</small>" in page
    assert "<small>ρ = 0.25, number 6</small>" in page
    assert NONE not in page


def test_rank_correlations_are_those_of_the_rows(tmp_path: Path) -> None:
    text = write_report(kept(tmp_path))[0].read_text()
    table = text.split("### Rank correlation of saliency with the cover's: second\n")[1]
    assert "\n| marked | 0.25 | 0.25 | – | 0.25 |\n" in table
    assert "\n| noise 0.50% | 0.50 | 0.50 | – | 0.50 |\n" in table
    assert "\n| subdivision loop | – · MeshError: no saliency | – · MeshError: no saliency | – | – |\n" in table
    assert "cover's: first" not in text  # it was not asked for


def test_a_folder_without_pictures_says_so_in_one_line(tmp_path: Path) -> None:
    for path in write_report(keep(tmp_path, PLAIN)):
        assert path.read_text().count(NONE) == 1
    assert "Saliency" not in (tmp_path / "report.md").read_text()


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("[", "damaged"),
        ('[{"mesh": "Vase"}]', "damaged"),
        ('[{"file": "pictures/0.jpg"}]', "damaged"),  # there is no such file
        ('[{"file": "../secret.jpg", "mesh": "Vase", "kind": "saliency"}]', "not in the folder"),
    ],
)
def test_a_list_of_pictures_that_is_wrong_is_refused(tmp_path: Path, text: str, reason: str) -> None:
    (tmp_path / "secret.jpg").write_bytes(JPEG)
    (keep(tmp_path / "out", PLAIN) / "pictures.json").write_text(text)
    with pytest.raises(SpecError, match=reason):
        write_report(tmp_path / "out")
