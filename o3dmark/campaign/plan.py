"""What a campaign measures, as pure data: the TOML file, and the jobs that follow from it.

title = "..."
bits = 64                       # or a list; what no code carries is embedded as raw random bits
seeds = 3                       # 0, 1, 2; or a list. A seed gives key, message and the attacks' randomness
code = "random"                 # between message and bits
metrics = ["mrms", "hausdorff", "msdm"]
wrong_keys = 0                  # readings of each marked mesh under so many other keys
files = ["scans/*.ply"]         # meshes by their file's name; paths are relative to the TOML file
[meshes]
Bimba = "bimba:vertices=3000"   # a shape, or the path of a file
[real]
Bimba = "bimba.ply"             # replaces the mesh of that name when a folder of real meshes is given
[methods]
"a name" = "saliency-scs:sync=rank"
[attacks.noise]                 # a table of the report; each line a condition: one attack, or several in order
"0.05%" = "noise:amplitude=0.0005"
"0.05%, 9 bit" = ["noise:amplitude=0.0005", "quantise:bits=9"]
[imperceptibility]              # which method stands for which line of the paper's table
"no saliency" = "a name"
[gallery]                       # what the report draws; attacks as "table/condition"
method = "a name"
meshes = ["Bimba"]
attacks = ["noise/0.05%"]
"""

import hashlib
import json
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from o3dmark.attacks import ATTACKS
from o3dmark.coding.payload import CODES
from o3dmark.errors import SpecError
from o3dmark.files import FORMATS
from o3dmark.methods import METHODS
from o3dmark.metrics import METRICS
from o3dmark.registry import Registry, spec_of
from o3dmark.synthetic import SHAPES

UNTOUCHED, STRANGER = "no attack", "wrong key"  # the two tables that every campaign may have beside its own
_KEYS = (
    *("title", "bits", "seeds", "code", "metrics", "wrong_keys", "files", "meshes", "real", "methods"),
    *("attacks", "imperceptibility", "gallery"),
)


@dataclass(frozen=True)
class Source:
    """Where a mesh comes from: a shape's spec, or a file with the SHA-256 of its content."""

    name: str
    source: str
    digest: str = ""

    @property
    def public(self) -> str:
        """The spec, or the file's name without its folder."""
        return Path(self.source).name if self.digest else self.source


@dataclass(frozen=True)
class Case:
    """Attacks applied in order: a line, ``condition``, of the report's table ``group``."""

    group: str
    condition: str
    attacks: tuple[str, ...]


@dataclass(frozen=True)
class Job:
    """One mesh, marked once by one method under one seed, and everything that it must go through."""

    mesh: Source
    label: str
    method: str
    n_bits: int
    code: str
    seed: int
    cases: tuple[Case, ...]
    wrong_keys: int
    metrics: tuple[str, ...]

    @property
    def id(self) -> str:
        """16 hexadecimal digits that any change of the job changes; the folder of a mesh file is no part of it."""
        content = asdict(self)
        content["mesh"]["source"] = self.mesh.public
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]

    @property
    def readings(self) -> tuple[Case, ...]:
        """Every reading of the job, a row each: unattacked, attacked, and under other keys."""
        strangers = (Case(STRANGER, str(number + 1), ()) for number in range(self.wrong_keys))
        return (Case(UNTOUCHED, "-", ()), *self.cases, *strangers)


@dataclass(frozen=True)
class Campaign:
    """A whole TOML file, checked. Names are those of its tables."""

    title: str
    meshes: tuple[Source, ...]
    methods: Mapping[str, str]
    cases: tuple[Case, ...]
    bits: tuple[int, ...] = (64,)
    seeds: tuple[int, ...] = (0,)
    code: str = "random"
    metrics: tuple[str, ...] = ("mrms", "hausdorff", "msdm")
    wrong_keys: int = 0
    imperceptibility: Mapping[str, str] | None = None
    gallery: Mapping[str, Any] | None = None

    @classmethod
    def read(cls, path: str | Path, real: str | Path | None = None) -> "Campaign":
        """The campaign in a TOML file; with ``real``, a folder, its [real] meshes replace those of the same names.

        Errors: SpecError, which names the key, for anything that does not make sense.
        """
        path = Path(path)
        try:
            content = tomllib.loads(path.read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
            raise SpecError(f"cannot read the campaign {path.name}: {error}") from None
        for key in content:
            if key not in _KEYS:
                close = get_close_matches(key, _KEYS, n=1)
                raise SpecError(
                    f"{key}: no such key; " + (f"did you mean {close[0]!r}?" if close else ", ".join(_KEYS))
                )
        return _campaign(content, path, None if real is None else Path(real))

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> "Campaign":
        """What `to_dict` wrote, after JSON."""
        fields = dict(content)
        fields["meshes"] = tuple(Source(**each) for each in content["meshes"])
        fields["cases"] = tuple(
            Case(each["group"], each["condition"], tuple(each["attacks"])) for each in content["cases"]
        )
        return cls(**fields | {name: tuple(content[name]) for name in ("bits", "seeds", "metrics")})

    def to_dict(self) -> dict[str, Any]:
        return asdict(self)

    def jobs(self) -> Iterator[Job]:
        """All jobs, those of one mesh together."""
        for mesh in self.meshes:
            for seed in self.seeds:
                for n_bits in self.bits:
                    for label, method in self.methods.items():
                        yield Job(
                            mesh,
                            label,
                            method,
                            n_bits,
                            self.code,
                            seed,
                            self.cases,
                            self.wrong_keys,
                            self.metrics,
                        )


def _campaign(content: dict[str, Any], path: Path, real: Path | None) -> Campaign:
    methods = {name: _spec(METHODS, f"methods.{name}", spec) for name, spec in _table(content, "methods").items()}
    meshes = _meshes(content, path.parent, real)
    if not methods or not meshes:
        raise SpecError(f"{'meshes' if methods else 'methods'}: a campaign needs one or more")
    cases = tuple(_cases(_table(content, "attacks")))
    seeds = content.get("seeds", 1)
    imperceptibility = _table(content, "imperceptibility")
    for line, label in imperceptibility.items():
        _one_of(f"imperceptibility.{line}", label, methods)
    return Campaign(
        title=_value(content, "title", str, path.stem),
        meshes=meshes,
        methods=methods,
        cases=cases,
        bits=_numbers("bits", content.get("bits", 64), least=1),
        seeds=tuple(range(seeds)) if type(seeds) is int and seeds > 0 else _numbers("seeds", seeds, least=0),
        code=_spec(CODES, "code", content.get("code", "random")),
        metrics=_metrics(_value(content, "metrics", list, list(Campaign.metrics))),
        wrong_keys=_numbers("wrong_keys", content.get("wrong_keys", 0), least=0)[0],
        imperceptibility=imperceptibility,
        gallery=_gallery(_table(content, "gallery"), methods, {mesh.name: mesh for mesh in meshes}, cases),
    )


def _meshes(content: dict[str, Any], folder: Path, real: Path | None) -> tuple[Source, ...]:
    found = {name: _source(f"meshes.{name}", name, spec, folder) for name, spec in _table(content, "meshes").items()}
    for pattern in _value(content, "files", list, []):
        paths = sorted(folder.glob(pattern)) if isinstance(pattern, str) else []
        if not paths:
            raise SpecError(f"files: nothing matches {pattern!r}")
        found |= {path.stem: _source("files", path.stem, str(path), folder) for path in paths}
    for name, file in (_table(content, "real") if real else {}).items():
        found[name] = _source(f"real.{name}", name, file, Path(str(real)))
    return tuple(found.values())


def _source(key: str, name: str, spec: Any, folder: Path) -> Source:
    if not isinstance(spec, str) or Path(spec).suffix.lower() not in FORMATS:
        return Source(name, _spec(SHAPES, key, spec))
    path = folder / spec
    try:
        return Source(name, str(path.resolve()), hashlib.sha256(path.read_bytes()).hexdigest())
    except OSError as error:
        raise SpecError(f"{key}: cannot read {spec!r}: {error.strerror}") from None


def _cases(groups: dict[str, Any]) -> Iterator[Case]:
    for group, conditions in groups.items():
        if group in (UNTOUCHED, STRANGER) or not isinstance(conditions, dict):
            raise SpecError(f"attacks.{group}: should be a table of conditions, and have a name of its own")
        for condition, specs in conditions.items():
            chain = specs if isinstance(specs, list) else [specs]
            key = f"attacks.{group}.{condition}"
            yield Case(group, condition, tuple(_spec(ATTACKS, key, spec) for spec in chain))


def _metrics(specs: list[Any]) -> tuple[str, ...]:
    metrics = tuple(_spec(METRICS, "metrics", spec) for spec in specs)
    if len({METRICS.make(spec).name for spec in metrics}) < len(metrics):
        raise SpecError("metrics: one is given twice; a row has one column for each name")
    return metrics


def _gallery(
    table: dict[str, Any], methods: Mapping[str, str], meshes: Mapping[str, Source], cases: tuple[Case, ...]
) -> dict[str, Any]:
    chosen = {
        "method": table.pop("method", next(iter(methods))),
        "meshes": table.pop("meshes", list(meshes)[:6]),
        "attacks": table.pop("attacks", []),
    }
    if table:
        raise SpecError(f"gallery.{next(iter(table))}: no such key; there is method, meshes and attacks")
    _one_of("gallery.method", chosen["method"], methods)
    for name in _value(chosen, "meshes", list, []):
        _one_of("gallery.meshes", name, meshes)
    for name in _value(chosen, "attacks", list, []):
        _one_of("gallery.attacks", name, {f"{case.group}/{case.condition}": case for case in cases})
    return chosen


def _spec(registry: Registry[Any], key: str, spec: Any) -> str:
    """The canonical text of a spec; SpecError names the key of the TOML file."""
    if not isinstance(spec, (str, dict)):
        raise SpecError(f"{key}: should be the text of a {registry.kind}, not {spec!r}")
    try:
        return spec_of(registry.make(spec))
    except SpecError as error:
        raise SpecError(f"{key}: {error}") from None


def _table(content: dict[str, Any], key: str) -> dict[str, Any]:
    return dict(_value(content, key, dict, {}))


def _value(content: dict[str, Any], key: str, kind: Callable[..., Any], default: Any) -> Any:
    value = content.get(key, default)
    if not isinstance(value, kind):  # type: ignore[arg-type]
        raise SpecError(f"{key}: should be a {getattr(kind, '__name__', kind)}, not {value!r}")
    return value


def _numbers(key: str, value: Any, least: int) -> tuple[int, ...]:
    numbers = value if isinstance(value, list) else [value]
    if not numbers or any(type(number) is not int or number < least for number in numbers):
        raise SpecError(f"{key}: should be whole numbers from {least} upwards, not {value!r}")
    if len(set(numbers)) < len(numbers):
        raise SpecError(f"{key}: a number is given twice in {value!r}")
    return tuple(numbers)


def _one_of(key: str, name: Any, known: Mapping[str, Any]) -> None:
    if not isinstance(name, str) or name not in known:
        raise SpecError(f"{key}: {name!r} is none of {', '.join(known)}")
