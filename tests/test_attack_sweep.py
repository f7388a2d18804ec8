"""The sweep of all attacks over many meshes: it has every attack, and every variant that an option names, once."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Literal, get_args, get_origin, get_type_hints

import pytest

from fixtures.small_campaign import ring
from o3dmark.attacks import ATTACKS
from o3dmark.campaign import find_spec, read_campaign, run_job
from o3dmark.files import write_mesh
from o3dmark.registry import describe, spec_of

pytestmark = pytest.mark.usefixtures("own_registries")


def variants() -> Iterator[str]:
    """Every attack by default, then with each option that is a choice or a switch set otherwise."""
    for name in ATTACKS:
        yield name
        hints = get_type_hints(ATTACKS[name])
        for option, _, default, _ in describe(ATTACKS[name]):
            choices = get_args(hints[option]) if get_origin(hints[option]) is Literal else ()
            choices = (True, False) if hints[option] is bool else choices
            yield from (spec_of(ATTACKS.make({"name": name, option: c})) for c in choices if c != default)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder of real meshes with one in each of the folders that the sweep looks into."""
    for name in ("paper/one.ply", "extra/textured/kip/two.obj"):
        (tmp_path / name).parent.mkdir(parents=True)
        write_mesh(tmp_path / name, ring())
    return tmp_path


def test_every_attack_and_every_named_choice_is_swept_once(folder: Path) -> None:
    plan, wanted = read_campaign(find_spec("attack_sweep"), folder), list(variants())
    specs = [" ".join(case.attacks) for case in plan.cases]
    assert len(specs) == len(set(specs))
    assert set(wanted) <= set(specs)
    assert len(wanted) > 60
    assert all(case.group == case.attacks[0].partition(":")[0] for case in plan.cases)
    assert sorted(mesh.name for mesh in plan.meshes) == ["one", "two"]


def test_nothing_is_hidden_and_attacks_are_made(folder: Path) -> None:
    job = next(read_campaign(find_spec("attack_sweep"), folder).jobs())
    quick = tuple(case for case in job.cases if case.group in ("crop", "mirror", "noise", "subdivide", "weld"))
    rows = run_job(replace(job, cases=quick)).rows
    assert len(rows) == 1 + len(quick) > 10
    assert {(row.outcome, row.log10_p, row.corr) for row in rows} == {("ok", 0.0, None)}
