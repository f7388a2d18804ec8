"""The TOML file that says what a campaign measures.

title = "..."
bits = 64                       # or a list; what no code carries is embedded as raw random bits
seeds = 3                       # 0, 1, 2; or a list. A seed gives key, message and the attacks' randomness
code = "random"                 # between message and bits
metrics = ["mrms", "hausdorff", "msdm"]         # what the mark costs, between cover and marked mesh
main = "a name"                 # the method that the campaign calls its own; by default the first
informed = ["a name"]           # methods whose reader is given the cover mesh though it could do without
wrong_keys = 0                  # readings of each marked mesh, unattacked, under so many other keys
unmarked = 0                    # readings of each unmarked mesh under so many keys
controls = ["noise"]            # tables whose every condition is also read with a wrong key, and from the unmarked mesh
saliency_rank = false           # Spearman's rho of every attacked mesh's saliency with the cover's
plugins = ["mine.py"]           # Python files that register own methods, attacks, metrics, codes or shapes
published = "figures.csv"       # somebody's figures: table,method,metric,condition,model,value
files = ["scans/*.ply"]         # meshes by their file's name, the smallest first
[meshes]
Bimba = "bimba:vertices=3000"   # a shape, or the path of a file
[real]
Bimba = "paper/bimba.ply"       # takes the place of the mesh of that name when a folder of real meshes is given
[methods]
"a name" = "saliency-scs:sync=rank"
[attacks.noise]                 # a table of the report; each line a condition: one attack, or several in order
"0.05%" = "noise:amplitude=0.0005"
"0.05%, 9 bit" = ["noise:amplitude=0.0005", "quantise:bits=9"]
                                # in place of such tables, attacks = "other.toml" takes those of another campaign
[published_names]               # what to call the methods of that CSV
hamidi = "the paper's method"
[imperceptibility]              # which method stands for which condition of its table "imperceptibility"
"no saliency" = "a name"
[gallery]                       # what is drawn of the main method: no such table, no pictures
meshes = ["Bimba"]              # by default the first six
attacks = ["noise/0.05%"]       # as "table/condition"
subject = "Bimba"               # the mesh to show after attacks; by default the first of these

Paths are relative to the TOML file; those of [real] and ``files`` to the folder of real meshes where one is given.
"""

import csv
import hashlib
import tomllib
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from o3dmark.attacks import ATTACKS
from o3dmark.campaign.plan import OWN_GROUPS, Campaign, Case, Gallery, Source
from o3dmark.campaign.plugins import Plugin, load_plugins
from o3dmark.coding.payload import CODES
from o3dmark.errors import SpecError
from o3dmark.files import FORMATS
from o3dmark.methods import METHODS
from o3dmark.metrics import METRICS
from o3dmark.registry import Registry, spec_of
from o3dmark.synthetic import SHAPES

SPECS = Path(__file__).parent / "specs"
_KEYS = (
    *("title", "bits", "seeds", "code", "metrics", "main", "informed", "wrong_keys", "unmarked", "controls"),
    *("saliency_rank", "plugins", "published", "files", "meshes", "real", "methods", "attacks", "published_names"),
    *("imperceptibility", "gallery"),
)
_PUBLISHED = ["table", "method", "metric", "condition", "model", "value"]


def find_spec(name: str) -> Path:
    """The TOML file of a campaign: a path that ends in .toml, or the name of one of the campaigns in this package.

    Errors: SpecError for a name that none of them has.
    """
    if name.endswith(".toml"):
        return Path(name)
    known = sorted(path.stem for path in SPECS.glob("*.toml"))
    if name not in known:
        close = get_close_matches(name, known, n=1)
        advice = f"did you mean {close[0]!r}?" if close else f"there is {', '.join(known)};"
        raise SpecError(f"no campaign is called {name!r}; {advice} a file of your own is named with its ending, .toml")
    return SPECS / f"{name}.toml"


def _toml(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise SpecError(f"cannot read the campaign {path.name}: {error}") from None


def read_campaign(
    path: str | Path, real: str | Path | None = None, *, only: Collection[str] = (), plugins: Iterable[str | Path] = ()
) -> Campaign:
    """The campaign in a TOML file; ``real`` is a folder of real meshes.

    ``only``: names of the meshes to take, in any case; without any, all. ``plugins`` are files beside those that the
    file names. Errors: SpecError, which names the key, for anything that does not make sense.
    """
    path = Path(path)
    content = _toml(path)
    _no_other_keys("", content, _KEYS)
    files = [*(path.parent / file for file in _texts(content, "plugins")), *plugins]
    loaded = tuple(Plugin.of(file) for file in files)
    load_plugins(loaded)
    return _campaign(content, path, None if real is None else Path(real), only, loaded)


def _campaign(
    content: dict[str, Any], path: Path, real: Path | None, only: Collection[str], plugins: tuple[Plugin, ...]
) -> Campaign:
    methods = {name: _spec(METHODS, f"methods.{name}", spec) for name, spec in _table(content, "methods").items()}
    meshes = _meshes(content, path.parent, real)
    if not methods or not meshes:
        raise SpecError(f"{'meshes' if methods else 'methods'}: a campaign needs one or more")
    cases = tuple(_cases(_attacks(content, path.parent)))
    seeds = content.get("seeds", 1)
    published = _published(content, path.parent)
    return Campaign(
        title=_value(content, "title", str, path.stem),
        meshes=tuple(_source(*meshes[name]) for name in _chosen(meshes, only)),
        methods=methods,
        cases=cases,
        main=_one_of("main", content.get("main", next(iter(methods))), methods),
        bits=_numbers("bits", content.get("bits", 64), least=1),
        seeds=tuple(range(seeds)) if type(seeds) is int and seeds > 0 else _numbers("seeds", seeds, least=0),
        code=_spec(CODES, "code", content.get("code", "random")),
        metrics=_metrics(_value(content, "metrics", list, list(Campaign.metrics))),
        informed=_informed(content, methods),
        wrong_keys=_numbers("wrong_keys", content.get("wrong_keys", 0), least=0)[0],
        unmarked=_numbers("unmarked", content.get("unmarked", 0), least=0)[0],
        controls=_texts(content, "controls", {case.group for case in cases}),
        saliency_rank=_value(content, "saliency_rank", bool, False),
        gallery=_gallery(content, meshes, cases),
        plugins=plugins,
        published=published,
        published_names=_names(content, "published_names", {line["method"] for line in figures(published)}),
        imperceptibility=_names(content, "imperceptibility", None, methods),
    )


# Meshes. A place is the key of the TOML file that names a mesh, the name, its spec, and the folder of relative paths.

_Place = tuple[str, str, Any, Path]


def _meshes(content: dict[str, Any], folder: Path, real: Path | None) -> dict[str, _Place]:
    shapes, files = _table(content, "meshes"), _table(content, "real")
    found = {name: (f"meshes.{name}", name, spec, folder) for name, spec in shapes.items()}
    found |= {name: ("files", name, path, folder) for name, path in _globbed(content, real or folder, found)}
    if real is not None:
        return found | {name: (f"real.{name}", name, file, real) for name, file in files.items()}
    for name in files:
        if name not in found:
            raise SpecError(f"real.{name}: this campaign needs the folder of its real meshes: --meshes FOLDER")
    return found


def _globbed(content: dict[str, Any], folder: Path, taken: Collection[str]) -> list[tuple[str, str]]:
    """(name, path) of each mesh file that a pattern matches: without its ending, unless two would be called so."""
    paths = {path.resolve(): None for pattern in _texts(content, "files") for path in _matching(folder, pattern)}
    found = sorted(paths, key=lambda path: (path.stat().st_size, path.name))
    wishes = [(path.stem, path.name, f"{path.parent.name}/{path.name}") for path in found]
    counts = [Counter(names) for names in zip(*wishes, strict=True)]
    return [
        (
            next(
                (name for n, name in zip(counts, names, strict=True) if n[name] == 1 and name not in taken), names[-1]
            ),
            path,
        )
        for names, path in zip(wishes, map(str, found), strict=True)
    ]


def _matching(folder: Path, pattern: str) -> Iterator[Path]:
    try:
        found = [path for path in folder.glob(pattern) if path.suffix.lower() in FORMATS and path.is_file()]
    except (NotImplementedError, ValueError, IndexError) as error:
        raise SpecError(
            f"files: {pattern!r} is no pattern of paths within {folder.name or folder}: {error}; a pattern is relative"
            " to the TOML file, or to --meshes FOLDER"
        ) from None
    if not found:
        raise SpecError(f"files: no mesh file matches {pattern!r} (endings: {', '.join(FORMATS)})")
    return iter(found)


def _chosen(meshes: Mapping[str, Any], only: Collection[str]) -> list[str]:
    by_name = {name.casefold(): name for name in meshes}
    for name in only:
        _one_of("--only", name.casefold(), by_name, shown=meshes)
    wanted = {by_name[name.casefold()] for name in only} or set(meshes)
    return [name for name in meshes if name in wanted]


def _source(key: str, name: str, spec: Any, folder: Path) -> Source:
    if not isinstance(spec, str) or Path(spec).suffix.lower() not in FORMATS:
        return Source(name, _spec(SHAPES, key, spec))
    path = folder / spec
    try:
        return Source(name, str(path.resolve()), hashlib.sha256(path.read_bytes()).hexdigest())
    except OSError as error:
        raise SpecError(f"{key}: cannot read {spec!r}: {error.strerror}") from None


# The other tables


def _attacks(content: dict[str, Any], folder: Path) -> dict[str, Any]:
    other = content.get("attacks")
    return _table(_toml(folder / other) if isinstance(other, str) else content, "attacks")


def _cases(groups: dict[str, Any]) -> Iterator[Case]:
    for group, conditions in groups.items():
        if group in OWN_GROUPS or not isinstance(conditions, dict):
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


def _informed(content: dict[str, Any], methods: Mapping[str, str]) -> tuple[str, ...]:
    labels = _texts(content, "informed", methods)
    for label in labels:
        if not METHODS.make(methods[label]).takes_reference:
            raise SpecError(f"informed: {label!r} ({methods[label]}) has no use for the cover mesh")
    return labels


def _gallery(content: dict[str, Any], meshes: Mapping[str, Any], cases: Iterable[Case]) -> Gallery | None:
    if "gallery" not in content:
        return None
    table = _table(content, "gallery")
    _no_other_keys("gallery.", table, ("meshes", "attacks", "subject"))
    shown = _texts(table, "meshes", meshes, "gallery.") if "meshes" in table else tuple(meshes)[:6]
    attacks = _texts(table, "attacks", [case.name for case in cases], "gallery.")
    return Gallery(shown, attacks, _one_of("gallery.subject", table.get("subject", next(iter(shown), "")), shown))


def figures(text: str) -> list[dict[str, str]]:
    """The lines of a CSV file of published figures. Errors: SpecError for other columns, or a value that is none."""
    lines = csv.DictReader(text.splitlines())
    if text and lines.fieldnames != _PUBLISHED:
        raise SpecError(f"published: the first line should be {','.join(_PUBLISHED)}")
    found = list(lines)
    for number, line in enumerate(found, start=2):
        try:
            float(line["value"])
        except (ValueError, TypeError):
            raise SpecError(f"published, line {number}: {line['value']!r} is no number") from None
    return found


def _published(content: dict[str, Any], folder: Path) -> str:
    name = _value(content, "published", str, "")
    try:
        return (folder / name).read_text(encoding="utf-8") if name else ""
    except (OSError, UnicodeDecodeError) as error:
        raise SpecError(f"published: cannot read {name!r}: {error}") from None


# Values


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


def _names(
    content: dict[str, Any], key: str, keys: Collection[str] | None, values: Collection[str] | None = None
) -> dict[str, str]:
    """A table of texts whose keys and values are among those given, where any are."""
    table = _table(content, key)
    for name, value in table.items():
        if keys is not None:
            _one_of(key, name, keys)
        _one_of(f"{key}.{name}", value, [value] if values is None and isinstance(value, str) else values or ())
    return table


def _texts(
    content: dict[str, Any], key: str, known: Collection[str] | None = None, prefix: str = ""
) -> tuple[str, ...]:
    """A list of texts, each among ``known`` where that is given."""
    texts = _value(content, key, list, [], prefix)
    for text in texts:
        _one_of(prefix + key, text, [text] if known is None and isinstance(text, str) else known or ())
    return tuple(texts)


def _value(content: dict[str, Any], key: str, kind: Callable[..., Any], default: Any, prefix: str = "") -> Any:
    value = content.get(key, default)
    if not isinstance(value, kind):  # type: ignore[arg-type]
        raise SpecError(f"{prefix}{key}: should be a {getattr(kind, '__name__', kind)}, not {value!r}")
    return value


def _numbers(key: str, value: Any, least: int) -> tuple[int, ...]:
    numbers = value if isinstance(value, list) else [value]
    if not numbers or any(type(number) is not int or number < least for number in numbers):
        raise SpecError(f"{key}: should be whole numbers from {least} upwards, not {value!r}")
    if len(set(numbers)) < len(numbers):
        raise SpecError(f"{key}: a number is given twice in {value!r}")
    return tuple(numbers)


def _one_of(key: str, name: Any, known: Collection[str], shown: Collection[str] | None = None) -> str:
    if not isinstance(name, str) or name not in known:
        raise SpecError(f"{key}: {name!r} is none of {', '.join(shown or known)}")
    return name


def _no_other_keys(prefix: str, table: Mapping[str, Any], known: Sequence[str]) -> None:
    for key in table:
        if key not in known:
            close = get_close_matches(key, known, n=1)
            advice = f"did you mean {close[0]!r}?" if close else ", ".join(known)
            raise SpecError(f"{prefix}{key}: no such key; {advice}")
