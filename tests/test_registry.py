"""Three spellings of one object, and refusals that name the nearest right spelling."""

import dataclasses
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from o3dmark.errors import SpecError
from o3dmark.registry import Registry, describe, option, spec_of, to_dict


@dataclass(frozen=True)
class Animal:
    name: ClassVar[str] = ""


ANIMALS: Registry[Animal] = Registry("animal")


@ANIMALS.register("otter")
@dataclass(frozen=True)
class Otter(Animal):
    length: float = option(0.7, "metres, nose to tail")
    pups: int | None = option(None, "how many; none: not counted")
    fur: Literal["brown", "black"] = option("brown", "colour")
    legs: Literal[3, 4] = option(4, "how many are left")
    awake: bool = option(True, "or asleep")
    call: str = option("squeak", "what it says")

    def __post_init__(self) -> None:
        if self.length <= 0:
            raise ValueError("length is above 0")


@ANIMALS.register("mole")
@dataclass(frozen=True)
class Mole(Animal):
    depth: int = option(2, "metres below ground")


OTTERS = st.builds(
    Otter,
    length=st.floats(1e-300, 1e300),
    pups=st.none() | st.integers(),
    fur=st.sampled_from(["brown", "black"]),
    legs=st.sampled_from([3, 4]),
    awake=st.booleans(),
    call=st.sampled_from(["squeak", "chirp"]),
)


@given(OTTERS)
def test_three_spellings_are_equal(otter: Otter) -> None:
    assert ANIMALS.make(spec_of(otter)) == ANIMALS.make(to_dict(otter)) == ANIMALS.make(otter) == otter


def test_canonical_text_leaves_defaults_out() -> None:
    assert spec_of(Otter()) == "otter"
    assert spec_of(Otter(fur="black", pups=0)) == "otter:pups=0,fur=black"


def test_iteration_is_by_name() -> None:
    assert list(ANIMALS) == ["mole", "otter"]
    assert ANIMALS["mole"] is Mole


def test_options_describe_themselves() -> None:
    rows = describe(Otter)
    assert rows[0] == ("length", "float", 0.7, "metres, nose to tail")
    assert [row[1] for row in rows] == ["float", "int or none", "brown|black", "3|4", "bool", "str"]


@pytest.mark.parametrize("spec", ["otter", "otter:", " otter : length = 0.7 ", "otter:length=0.7,", {"name": "otter"}])
def test_lenient_spellings(spec: "str | dict[str, Any]") -> None:
    assert ANIMALS.make(spec) == Otter()


@pytest.mark.parametrize(
    ("spec", "complaint"),
    [
        ("oter", "did you mean 'otter'"),
        ("zebra!", "mole, otter"),
        ("", "no animal is called ''"),
        ({}, "no animal is called ''"),
        ("otter:lenght=1", "did you mean 'length'"),
        ("otter:length", "option=value"),
        ("otter:length=1,length=2", "given twice"),
        ("otter:length=long", "float, not 'long'"),
        ("otter:pups=2.5", "int or none, not '2.5'"),
        ({"name": "otter", "pups": 2.5}, "int or none, not 2.5"),
        ({"name": "otter", "length": [1.0]}, "float, not"),
        ({"name": "otter", "length": None}, "float, not None"),
        ("otter:fur=green", "brown|black"),
        ("otter:awake=perhaps", "bool"),
        ("otter:length=-1", "length is above 0"),
    ],
)
def test_a_wrong_spec_is_refused_with_the_right_one(spec: "str | dict[str, Any]", complaint: str) -> None:
    with pytest.raises(SpecError) as caught:
        ANIMALS.make(spec)
    assert complaint in str(caught.value)


def test_a_spec_is_not_changed_by_reading_it() -> None:
    spec = {"name": "otter", "length": 1.0}
    ANIMALS.make(spec)
    assert spec == {"name": "otter", "length": 1.0}


def test_two_classes_cannot_share_a_name() -> None:
    with pytest.raises(ValueError, match="two classes"):
        ANIMALS.register("otter")(Mole)


@pytest.mark.parametrize("cls", [object, dataclasses.make_dataclass("Thawed", ["x"])])
def test_only_frozen_dataclasses_register(cls: type) -> None:
    with pytest.raises(TypeError, match="frozen dataclass"):
        ANIMALS.register("odd")(cls)


def test_a_class_is_found_by_its_file_being_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "found_by_being_there"
    folder.mkdir()
    (folder / "__init__.py").write_text("from o3dmark.registry import Registry\nR = Registry('thing', __name__)\n")
    (folder / "one.py").write_text(
        "from dataclasses import dataclass\nfrom found_by_being_there import R\n"
        "@R.register('one')\n@dataclass(frozen=True)\nclass One:\n    pass\n"
    )
    (folder / "_private.py").write_text("raise AssertionError('modules with an underscore are not searched')\n")
    monkeypatch.syspath_prepend(tmp_path)
    package = __import__("found_by_being_there")
    assert "found_by_being_there.one" not in sys.modules
    assert list(package.R) == ["one"]
    assert package.R.make("one").name == "one"


def test_a_name_is_looked_for_in_its_own_module_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Others are imported for a name that no module has, and for the list of all."""
    folder = tmp_path / "looked_into"
    folder.mkdir()
    (folder / "__init__.py").write_text("from o3dmark.registry import Registry\nR = Registry('thing', __name__)\n")
    names = {"the_first": ["the-first", "another"], "second": ["second"], "_third": []}
    for module, made in names.items():
        classes = [f"@R.register({n!r})\n@dataclass(frozen=True)\nclass C{k}:\n    pass\n" for k, n in enumerate(made)]
        head = "from dataclasses import dataclass\nfrom looked_into import R\n"
        (folder / f"{module}.py").write_text(head + "".join(classes))
    monkeypatch.syspath_prepend(tmp_path)
    registry = __import__("looked_into").R

    def imported() -> set[str]:
        return {name.partition(".")[2] for name in sys.modules if name.startswith("looked_into.")}

    assert registry["the-first"].name == "the-first"
    assert imported() == {"the_first"}
    assert registry["another"].name == "another"
    assert imported() == {"the_first"}
    with pytest.raises(SpecError, match="another, second, the-first"):
        registry["_third"]
    assert imported() == {"the_first", "second"}
    assert list(registry) == ["another", "second", "the-first"]
