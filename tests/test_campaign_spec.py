"""What a TOML file may say, and what is said of one that is wrong; the campaigns inside the package are sound."""

import json
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from fixtures.paths import GOLDEN, ROOT
from fixtures.small_campaign import TOML, campaign, ring
from o3dmark.campaign import Campaign, Gallery, find_spec, read_campaign
from o3dmark.campaign.published import figures
from o3dmark.campaign.spec_file import SPECS
from o3dmark.errors import SpecError
from o3dmark.files import write_mesh

pytestmark = pytest.mark.usefixtures("own_registries")
FIGURES = "table,method,metric,condition,model,value\nnoise,theirs,corr,0.05%,Ring,0.9\n"
NAMES = sorted(path.stem for path in SPECS.glob("*.toml"))


def test_real_meshes_take_the_place_of_their_stand_ins(tmp_path: Path) -> None:
    text = TOML.replace("ring.ply", "vase") + '[real]\nRing = "spot.ply"\n'
    assert [mesh.public for mesh in campaign(tmp_path, text).meshes] == ["vase"]
    (mesh,) = campaign(tmp_path, text, real=GOLDEN).meshes
    assert (mesh.name, mesh.public, len(mesh.digest)) == ("Ring", "spot.ply", 64)
    with pytest.raises(SpecError, match=r"real.Spot: this campaign needs the folder of its real meshes: --meshes"):
        campaign(tmp_path, text.replace("[real]\nRing", "[real]\nSpot"))


def test_one_mesh_can_be_had_although_others_are_not_there(tmp_path: Path) -> None:
    text = TOML + '[real]\nSpot = "spot.ply"\nNowhere = "nowhere.ply"\n'
    assert [mesh.name for mesh in campaign(tmp_path, text, real=GOLDEN, only=["spot"]).meshes] == ["Spot"]
    with pytest.raises(SpecError, match=r"real.Nowhere: cannot read 'nowhere.ply'"):
        campaign(tmp_path, text, real=GOLDEN)


def test_patterns_name_meshes_by_their_files_the_smallest_first(tmp_path: Path) -> None:
    for name, size in {"b.ply": 30, "a.ply": 45, "deep/c.ply": 20, "deep/b.off": 25, "deep/Ring.ply": 35}.items():
        (tmp_path / "scans" / name).parent.mkdir(parents=True, exist_ok=True)
        write_mesh(tmp_path / "scans" / name, ring(size))
    (tmp_path / "scans" / "b.png").write_text("no mesh")
    plan = campaign(tmp_path, f'files = ["scans/**/*", "scans/a.*"]\n{TOML}')
    assert [mesh.name for mesh in plan.meshes] == ["Ring", "c", "b.ply", "Ring.ply", "b.off", "a"]
    elsewhere = campaign(tmp_path, f'files = ["deep/*"]\n{TOML}', real=tmp_path / "scans")
    assert [mesh.name for mesh in elsewhere.meshes] == ["Ring", "c", "Ring.ply", "b"]


@pytest.mark.parametrize("pattern", ["/etc/*.ply", "none/*.ply", "", "**.ply", "../../../*.ply", "[.ply"])
def test_a_pattern_that_matches_nothing_is_named(tmp_path: Path, pattern: str) -> None:
    (tmp_path / "a" / "b" / "c").mkdir(parents=True)
    with pytest.raises(SpecError, match=r"files: no mesh file .* relative to --meshes FOLDER"):
        campaign(tmp_path / "a" / "b" / "c", f'files = ["{pattern}"]\n{TOML}')


def test_attacks_can_be_those_of_another_file(tmp_path: Path) -> None:
    (tmp_path / "other.toml").write_text('[attacks.noise]\nx = "noise"\n')
    plan = campaign(tmp_path, 'attacks = "other.toml"\n' + TOML[: TOML.index("[attacks")])
    assert [(case.name, case.attacks) for case in plan.cases] == [("noise/x", ("noise",))]


def test_seeds_are_counted_or_listed(tmp_path: Path) -> None:
    for text, seeds in {"3": (0, 1, 2), "[3]": (3,), "[4, 2]": (4, 2), "1": (0,)}.items():
        assert campaign(tmp_path, TOML.replace("[0, 5]", text)).seeds == seeds


def test_what_a_campaign_calls_its_own_and_what_it_shows(tmp_path: Path) -> None:
    assert campaign(tmp_path).main == "one"
    assert campaign(tmp_path).gallery is None
    plan = campaign(tmp_path, 'main = "two"\n' + TOML + '[gallery]\nattacks = ["noise/0.05%"]\n')
    assert (plan.main, plan.gallery) == ("two", Gallery(("Ring",), ("noise/0.05%",), "Ring"))
    drawn = {(job.label, job.seed): (job.gallery, job.subject) for job in plan.jobs()}
    assert drawn == {
        ("two", 0): (("noise/0.05%",), True),
        **dict.fromkeys([("one", 0), ("one", 5), ("two", 5)], (None, False)),
    }


def test_published_figures_are_kept(tmp_path: Path) -> None:
    (tmp_path / "figures.csv").write_text(FIGURES)
    text = 'published = "figures.csv"\n' + TOML + '[published_names]\ntheirs = "Theirs 2019"\n'
    plan = campaign(tmp_path, text)
    (tmp_path / "figures.csv").unlink()
    kept = Campaign.from_dict(json.loads(json.dumps(plan.to_dict())))
    assert figures(kept.published) == (("noise", "theirs", "corr", "0.05%", "Ring", 0.9),)
    assert kept.published_names == {"theirs": "Theirs 2019"}
    for old, new, complaint in [
        ("", "", "published: cannot read 'figures.csv'"),
        ("model", "mesh", "published: the first line should be table,method"),
        ("0.9", "high", "published, line 2: should be .* with a number"),
        (",0.9", "", "published, line 2: should be .* with a number"),
        ("theirs", "ours", "published_names: 'theirs' is none of ours"),
    ]:
        if old:
            (tmp_path / "figures.csv").write_text(FIGURES.replace(old, new))
        with pytest.raises(SpecError, match=complaint):
            campaign(tmp_path, text)


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("bits = 64", "bits = 0", "bits: "),
        ("bits = 64", 'bits = "many"', "bits: "),
        ("bits = 64", "bitz = 64", "bitz: .*did you mean 'bits'"),
        ("seeds = [0, 5]", "seeds = [1, 1]", "seeds: .*twice"),
        ("seeds = [0, 5]", "seeds = 0.5", "seeds: "),
        ("wrong_keys = 1", "wrong_keys = -1", "wrong_keys: "),
        ("wrong_keys = 1", "unmarked = [1]", "unmarked: should be a int"),
        ("wrong_keys = 1", 'controls = ["noize"]', "controls: 'noize' is none of noise, cropping"),
        ("wrong_keys = 1", 'informed = ["three"]', "informed: 'three' is none of one, two"),
        ("wrong_keys = 1", 'main = "three"', "main: 'three' is none of one, two"),
        ("wrong_keys = 1", "saliency_rank = 1", "saliency_rank: should be a bool"),
        ('"toy.py"', '"joy.py"', "cannot read the plug-in joy.py"),
        ('["mrms:samples=2000"]', '["mrmz"]', "metrics: .*mrms"),
        ('["mrms:samples=2000"]', '["mrms", "mrms:samples=9"]', "metrics: .*twice"),
        ('["mrms:samples=2000"]', '"mrms"', "metrics: should be a list"),
        ("ring.ply", "none.ply", "meshes.Ring: cannot read"),
        ('"ring.ply"', '"sput"', "meshes.Ring: no shape is called 'sput'"),
        ('"ring.ply"', "7", "meshes.Ring: should be the text of a shape"),
        ('"toy"', '"magic:a=1"', "methods.one: no method is called 'magic'"),
        ("needs=true", "needs=perhaps", "methods.two: "),
        ("noise:amplitude=0.0005", "noise:size=1", "attacks.noise.0.05%: .*no option 'size'"),
        ('["crop:share=0.1", "reorder"]', "7", "attacks.cropping.10%, shuffled: "),
        *(("[attacks.noise]", f'[attacks."{name}"]', f"attacks.{name}: ") for name in ("no attack", "unmarked")),
        ("[meshes]", 'attacks = "other.toml"\n[meshes]', "cannot read the campaign campaign.toml: Cannot"),
        ("[meshes]", '[imperceptibility]\nx = "y"\n[meshes]', "imperceptibility.x: 'y' is none of one, two"),
        ("[meshes]", '[published_names]\nx = "y"\n[meshes]', "published_names: 'x' is none of"),
        ("[meshes]", '[gallery]\nattacks = ["noise/9%"]\n[meshes]', "gallery.attacks: 'noise/9%'"),
        ("[meshes]", '[gallery]\nsubject = "Wing"\n[meshes]', "gallery.subject: 'Wing' is none of Ring"),
        ("[meshes]", "[gallery]\nsize = 3\n[meshes]", "gallery.size: no such key"),
        ("[meshes]", "[shapes]", "shapes: no such key"),
        ("[meshes]", 'code = "x"\n[meshes]', "code: no code is called 'x'"),
        ('title = "small"', "title = small", "cannot read the campaign"),
    ],
)
def test_mistakes_in_the_file_are_named(tmp_path: Path, old: str, new: str, complaint: str) -> None:
    assert old in TOML
    with pytest.raises(SpecError, match=complaint):
        campaign(tmp_path, TOML.replace(old, new))


def test_a_method_that_has_no_use_for_the_cover_is_not_given_it(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match=r"informed: 'one' .* has no use for the cover"):
        campaign(tmp_path, 'informed = ["one"]\n' + TOML.replace('"toy"', '"saliency-scs"'))


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match=r"nowhere\.toml"):
        read_campaign(tmp_path / "nowhere.toml")


@pytest.mark.parametrize(("name", "advice"), [("quik", "did you mean 'quick'"), ("zzz", "there is any_mesh, .*quick")])
def test_a_campaign_that_is_none_is_refused_with_advice(name: str, advice: str) -> None:
    with pytest.raises(SpecError, match=f"no campaign is called '{name}'; .*{advice}.*ending, .toml"):
        find_spec(name)


@pytest.mark.parametrize("name", NAMES)
def test_the_campaigns_of_the_package_are_sound(name: str, tmp_path: Path) -> None:
    path = find_spec(name)
    text = path.read_text()
    assert f"o3dmark bench {name}" in text, "its first lines say how to run it"
    for file in re.findall(r'= "(\S+\.ply)"', text):
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        write_mesh(tmp_path / file, ring(20))
    for folder in ("paper", "extra", "defects"):
        (tmp_path / folder).mkdir(exist_ok=True)
        write_mesh(tmp_path / folder / "any.ply", ring(20))
    plan = read_campaign(path, tmp_path)
    jobs = list(plan.jobs())
    assert (
        len({job.id for job in jobs})
        == len(jobs)
        == len(plan.meshes) * len(plan.methods) * len(plan.seeds) * len(plan.bits)
    )
    shapes = ["Bimba", "Ant", "Cup", "Cat", "Bracket", "Car"]
    synthetic = {
        "comparison": shapes,
        "comparison_published": shapes,
        "false_positives_single": ["Bimba"],
        "quick": ["Flower", "Vase", "Bimba"],
        "comparison_semi_regular": ["Bimba", "Horse", "Cup"],
    }
    assert [mesh.name for mesh in plan.meshes if not mesh.digest] == synthetic.get(name, [])


@pytest.mark.parametrize(
    "name", ["quick", "paper", "stress", "false_positives", "comparison", "comparison_semi_regular"]
)
def test_some_campaigns_need_no_file(name: str) -> None:
    assert not any(mesh.digest for mesh in read_campaign(find_spec(name)).meshes)


def test_every_model_of_the_paper_is_compared_under_its_name() -> None:
    """A mesh is compared with the figures of its own name alone, so the names have to be those."""
    models = {figure.model for figure in figures((SPECS / "hamidi2019.csv").read_text())}
    assert {mesh.name for mesh in read_campaign(find_spec("paper")).meshes} == models


def test_the_wheel_holds_the_campaigns(tmp_path: Path) -> None:
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    names = {Path(name) for name in zipfile.ZipFile(wheel).namelist()}
    assert {Path("o3dmark/campaign/specs") / path.name for path in SPECS.glob("*.*")} <= names
    assert len(NAMES) > 10


def test_the_format_is_told_of_in_one_place() -> None:
    from o3dmark.campaign import spec_file

    for key in spec_file._KEYS:
        assert f"\n{key} = " in spec_file.__doc__ or f"\n[{key}" in spec_file.__doc__, key
