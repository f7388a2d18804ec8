"""One job: what its rows say, its seeds and keys, its controls, and what happens when something fails."""

import dataclasses
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fixtures.small_campaign import TOML, campaign, ring
from o3dmark.attacks import ATTACKS, Attack
from o3dmark.campaign import Job, Plugin, Row, Source, read_campaign, run_job
from o3dmark.campaign.checks import checked_attacks
from o3dmark.campaign.plan import Case
from o3dmark.campaign.spec_file import SPECS
from o3dmark.campaign.specimen import Specimen, key_of
from o3dmark.coding.detection import detect
from o3dmark.files import write_mesh
from o3dmark.mesh.surface import TriangleMesh, mesh_arrays
from o3dmark.registry import option

pytestmark = pytest.mark.usefixtures("own_registries")
REAL = """
bits = 32
seeds = [3]
wrong_keys = 2
metrics = ["mrms:samples=2000"]
[meshes]
Spot = "spot.ply"
[methods]
sphere = "saliency-scs:search=false,sigma=1"
[attacks.noise]
"0.05%" = "noise:amplitude=0.0005"
"""


def job_of(folder: Path, text: str = TOML) -> Job:
    return next(campaign(folder, text).jobs())


def rows_of(folder: Path, text: str = TOML) -> tuple[Row, ...]:
    return run_job(job_of(folder, text)).rows


def toy() -> Any:
    """The plug-in's module."""
    return next(module for module in sys.modules.values() if hasattr(module, "LOOKED_AT"))


def test_a_row_is_what_the_watermark_says(tmp_path: Path, spot: TriangleMesh) -> None:
    write_mesh(tmp_path / "spot.ply", spot)
    (tmp_path / "real.toml").write_text(REAL)
    job = next(read_campaign(tmp_path / "real.toml").jobs())
    made, rows = Specimen.of(job), {(row.group, row.condition): row for row in run_job(job).rows}
    for name, key, case in [
        (("no attack", "-"), made.key, Case("no attack", "-")),
        (("noise", "0.05%"), made.key, job.cases[0]),
        (("wrong key", "2"), key_of("wrong key 2 of seed 3"), Case("no attack", "-")),
    ]:
        row, expected = rows[name], made.expected(key)
        read = made.watermark.extract_bits(made.attacked(case), key)
        decoded = made.watermark.code.decode(read.soft, key, hypotheses=read.hypotheses)
        nearest = read.nearest(expected)
        assert row.failure is None
        assert row.bit_errors == np.count_nonzero(read.bits != expected)
        assert row.ber == pytest.approx(row.bit_errors / 32)
        assert row.corr == pytest.approx(np.corrcoef(read.bits, expected)[0, 1], abs=1e-5)
        assert row.log10_p == pytest.approx(detect(read.soft, expected, hypotheses=read.hypotheses).log10_p, rel=1e-5)
        assert row.log10_p_uncharged == pytest.approx(detect(read.soft, expected).log10_p, rel=1e-5)
        assert row.log10_p_best == pytest.approx(
            detect(nearest.soft, expected, hypotheses=nearest.hypotheses).log10_p, rel=1e-5
        )
        assert row.log10_p_message == pytest.approx(decoded.log10_p, rel=1e-5)
        assert (row.message_ok, row.message_read) == (decoded.message == made.message, decoded.found)
        assert row.hypotheses == read.hypotheses > 1
        assert 0 < (row.metrics["mrms"] or 0) <= 6e-4
    assert rows["no attack", "-"].message_ok is True
    assert rows["wrong key", "1"].message_ok is False


def test_marking_marks(tmp_path: Path) -> None:
    made = Specimen.of(job_of(tmp_path))
    with pytest.raises(AssertionError):
        np.testing.assert_array_equal(np.asarray(made.cover.vertices), np.asarray(made.marked.vertices))


def test_raw_bits_have_no_message(tmp_path: Path) -> None:
    rows = rows_of(tmp_path, TOML.replace("bits = 64", "bits = 16"))
    assert {(row.message_ok, row.message_read, row.log10_p_message) for row in rows} == {(None, None, None)}
    assert rows[0].bit_errors == 0


def test_corr_is_null_where_the_bits_are_constant(tmp_path: Path) -> None:
    rows = rows_of(tmp_path, TOML.replace("bits = 64", "bits = 1"))
    assert {row.corr for row in rows} == {None}
    assert rows[0].bit_errors == 0


def moved(folder: Path, case: Case, seed: int, *, unmarked: bool = False) -> Any:
    """The vertices (n, 3) of the specimen of a job after a case, less those before."""
    made = dataclasses.replace(Specimen.of(job_of(folder)), seed=seed)
    before = made.cover if unmarked else made.marked
    return np.asarray(made.attacked(case, unmarked=unmarked).vertices) - np.asarray(before.vertices)


def test_the_attacks_of_another_seed_or_condition_are_others(tmp_path: Path) -> None:
    noise = ("noise:amplitude=0.01",)
    first = moved(tmp_path, Case("noise", "1%", noise), 0)
    assert np.array_equal(first, moved(tmp_path, Case("noise", "1%", noise), 0))
    for other in [
        moved(tmp_path, Case("noise", "1%", noise), 1),
        moved(tmp_path, Case("noise", "again", noise), 0),
        moved(tmp_path, Case("again", "1%", noise), 0),
    ]:
        assert abs(np.corrcoef(first.ravel(), other.ravel())[0, 1]) < 0.1


def test_rows_of_another_seed_have_other_attacks_keys_and_messages(tmp_path: Path) -> None:
    first, second = (Specimen.of(job) for job in campaign(tmp_path).jobs() if job.label == "one")
    assert first.key != second.key
    assert first.message != second.message
    assert np.mean(first.expected(first.key) == second.expected(first.key)) < 0.9
    case = job_of(tmp_path).cases[0]
    shift = [np.asarray(made.attacked(case).vertices) - np.asarray(made.marked.vertices) for made in (first, second)]
    assert abs(np.corrcoef(shift[0].ravel(), shift[1].ravel())[0, 1]) < 0.1


def test_the_unmarked_mesh_is_attacked_alike(tmp_path: Path) -> None:
    case = Case("noise", "1%", ("noise:amplitude=0.01",))
    np.testing.assert_allclose(moved(tmp_path, case, 0, unmarked=True), moved(tmp_path, case, 0), rtol=1e-2, atol=1e-6)


CONTROLS = (
    TOML.replace("wrong_keys = 1", 'wrong_keys = 30\nunmarked = 30\ncontrols = ["similarity"]')
    + '[attacks.similarity]\n"turned by none" = "similarity:translation=0,rotation=0,smallest=1,largest=1"\n'
)


def test_controls_are_read_and_say_nothing(tmp_path: Path) -> None:
    job = job_of(tmp_path, CONTROLS)
    rows = run_job(job).rows
    names = [(row.control, row.group, row.condition) for row in rows]
    assert len(set(names)) == len(names) == 1 + 2 + 1 + 30 + 30 + 2
    assert {name for name in names if name[1] == "similarity"} == {
        (control, "similarity", "turned by none") for control in ("", "wrong key", "unmarked")
    }
    assert {row.control for row in rows if row.group in ("noise", "cropping", "no attack")} == {""}
    marked = next(row for row in rows if (row.group, row.control) == ("similarity", ""))
    assert marked.bit_errors == 0
    for control in ("wrong key", "unmarked"):
        found = [row for row in rows if row.control == control]
        assert len(found) == 31
        assert len({row.bit_errors for row in found}) > 5, "other keys read other bits"
        assert abs(np.mean([row.ber or 0 for row in found]) - 0.5) < 4 * 0.5 / np.sqrt(31 * 64)
        assert not any(row.message_read for row in found)
        assert np.mean([10.0 ** (row.log10_p_uncharged or 0) <= 0.1 for row in found]) < 0.3
        attacked = next(row for row in found if row.group == "similarity")
        assert (attacked.bit_errors or 0) > 10


def test_a_mesh_is_looked_at_once_for_all_keys(tmp_path: Path) -> None:
    job = job_of(tmp_path, CONTROLS)
    looked_at = toy().LOOKED_AT
    looked_at.clear()
    run_job(job)
    assert len(looked_at) == 1 + 3 + 1 + 1  # marked, after each attack; cover, after the attack of the controls


def test_a_reader_is_given_the_cover_where_the_campaign_says_so(tmp_path: Path) -> None:
    for text, wanted in ((TOML, False), ('informed = ["one"]\n' + TOML, True)):
        job = job_of(tmp_path, text)
        given = toy().GIVEN
        given.clear()
        run_job(job)
        assert [reference is not None for reference in given] == [wanted] * 4


@dataclass(frozen=True)
class Broken(Attack):
    """Goes wrong in a way of one's choice."""

    way: str = option("raises", "what goes wrong")

    def attack(self, mesh: Any, rng: np.random.Generator) -> Any:
        """See `Attack.attack`."""
        if self.way == "raises":
            raise RuntimeError("out of luck")
        other = mesh if self.way == "changed" else TriangleMesh() if self.way == "empty" else TriangleMesh(mesh)
        if self.way in ("nan", "changed"):
            other.vertices[3] = [float("nan")] * 3 if self.way == "nan" else [9.0, 9.0, 9.0]
        if self.way == "index":
            other.triangles[3] = [0, 1, 10_000]
        if self.way == "colours":
            mesh.paint_uniform_color([1.0, 0.0, 0.0])
        return other


@pytest.fixture
def broken() -> Iterator[None]:
    ATTACKS.register("broken")(Broken)
    yield
    del ATTACKS._classes["broken"]


@pytest.mark.usefixtures("broken")
@pytest.mark.parametrize(
    ("way", "reason", "outcome"),
    [
        ("raises", "attack: RuntimeError: out of luck", "failed"),
        ("nan", "attack: BadResultError: broken:way=nan: a vertex is not finite", "failed"),
        ("empty", "attack: BadResultError: broken:way=empty: no triangle", "failed"),
        ("index", "attack: BadResultError: broken:way=index: an index is out of range", "failed"),
        ("changed", "attack: BadResultError: broken:way=changed: the input was changed", "failed"),
        ("colours", "attack: BadResultError: broken:way=colours: the input was changed", "failed"),
    ],
)
def test_an_attack_that_fails_is_a_row_and_spoils_no_other(tmp_path: Path, way: str, reason: str, outcome: str) -> None:
    text = TOML.replace('"noise:amplitude=0.0005"', f'["weld", "broken:way={way}"]') + '"none" = "identity"\n'
    rows = rows_of(tmp_path, text)
    assert [row.failure for row in rows] == [None, None, reason, None, None]
    assert rows[2].outcome == outcome
    assert rows[2].corr is rows[2].bit_errors is rows[2].seconds is None
    assert all((row.metrics["mrms"] or 0) > 0 for row in rows)
    assert rows[4].bit_errors == 0


def test_a_metric_that_has_no_value_says_why(tmp_path: Path) -> None:
    plugins = (Plugin.of(SPECS / "attack_sweep.py"),)
    job = dataclasses.replace(job_of(tmp_path), method="nothing", plugins=plugins, metrics=("mrms", "snr"))
    for row in run_job(job).rows:
        assert row.metrics == {"mrms": pytest.approx(0.0, abs=1e-12), "snr": None, "hausdorff": None, "msdm": None}
        assert row.cost_failure == "snr: inf is no number that can be kept"
        assert row.failure is None


def test_a_refusal_is_told_from_a_failure(tmp_path: Path) -> None:
    job = dataclasses.replace(job_of(tmp_path), cases=(Case("cropping", "all", ("crop:share=0.99",) * 3),))
    refused = next(row for row in run_job(job).rows if row.group == "cropping")
    assert refused.outcome == "refused"
    assert str(refused.failure).startswith("attack: MeshError: ")


def test_a_mesh_that_cannot_be_marked_fails_in_every_row(tmp_path: Path) -> None:
    (tmp_path / "spot.toml").write_text(REAL.replace("32", "4000").replace("spot.ply", "ring.ply"))
    campaign(tmp_path)
    job = next(read_campaign(tmp_path / "spot.toml").jobs())
    rows = run_job(job).rows
    assert len(rows) == len(job.readings)
    assert all(str(row.failure).startswith("marking: CapacityError: 4000 bits") for row in rows)
    assert {row.outcome for row in rows} == {"refused"}
    assert {row.metrics["mrms"] for row in rows} == {None}


def test_a_file_that_has_changed_is_not_measured(tmp_path: Path) -> None:
    job = job_of(tmp_path)
    write_mesh(tmp_path / "ring.ply", ring(44))
    assert all("is not the file" in str(row.failure) for row in run_job(job).rows)


def test_no_row_names_a_folder_of_the_machine(tmp_path: Path) -> None:
    job = job_of(tmp_path)
    (tmp_path / "ring.ply").unlink()
    rows = run_job(job).rows
    assert all("ring.ply" in str(row.failure) and str(tmp_path) not in str(row.failure) for row in rows)


def test_attacks_under_supervision_are_those_of_attack_all(spot: TriangleMesh) -> None:
    from o3dmark.attacks import attack_all

    chain = ("reorder", "noise:amplitude=0.01", "simplify:ratio=0.5")
    for ours, theirs in zip(
        mesh_arrays(checked_attacks(spot, chain, 7)), mesh_arrays(attack_all(spot, chain, 7)), strict=True
    ):
        assert np.array_equal(ours, theirs)


def test_the_hash_names_the_content_and_not_the_folder(tmp_path: Path) -> None:
    first, *others = campaign(tmp_path).jobs()
    assert first.id == next(campaign(tmp_path).jobs()).id
    assert len({first.id, *(job.id for job in others)}) == 1 + len(others)
    moved = dataclasses.replace(first.mesh, source="/elsewhere/ring.ply")
    plugin = dataclasses.replace(first.plugins[0], path="/elsewhere/toy.py")
    assert dataclasses.replace(first, mesh=moved, plugins=(plugin,)).id == first.id
    changes: list[dict[str, Any]] = [
        *({"seed": 9}, {"n_bits": 17}, {"wrong_keys": 0}, {"cases": first.cases[:1]}, {"unmarked": 1}),
        *({"mesh": dataclasses.replace(first.mesh, digest="0")}, {"metrics": ()}, {"method": "shape-spectrum"}),
        *({"controls": ("noise",)}, {"informed": True}, {"gallery": ()}, {"gallery": ("noise/0.05%",)}, {"code": "x"}),
        *({"plugins": ()}, {"plugins": (dataclasses.replace(plugin, digest="0"),)}, {"saliency_rank": True}),
        *({"label": "other"}, {"subject": True}),
    ]
    assert {name for change in changes for name in change} == {each.name for each in dataclasses.fields(Job)}
    assert len({dataclasses.replace(first, **change).id for change in changes} | {first.id}) == 1 + len(changes)


def test_a_hash_stays_what_it_was() -> None:
    """Written by the first version: rows kept since then must not be measured again."""
    cases = (Case("noise", "0.05%", ("noise:amplitude=0.0005",)),)
    job = Job(Source("Bimba", "bimba"), "a", "saliency-scs", 64, "random", 0, cases, 2, ("mrms",))
    assert job.id == "1e1e4f94142baa3a"
