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

import tomllib
from collections.abc import Collection, Iterable, Iterator, Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from o3dmark.attacks import ATTACKS
from o3dmark.campaign.plan import OWN_GROUPS, Campaign, Case, Gallery
from o3dmark.campaign.plugins import Plugin, load_plugins
from o3dmark.campaign.published import figures
from o3dmark.campaign.spec_meshes import chosen, wanted_meshes
from o3dmark.campaign.spec_values import Table, checked_spec, one_of
from o3dmark.coding.payload import CODES
from o3dmark.errors import SpecError
from o3dmark.methods import METHODS
from o3dmark.metrics import METRICS

SPECS = Path(__file__).parent / "specs"
_KEYS = (
    *("title", "bits", "seeds", "code", "metrics", "main", "informed", "wrong_keys", "unmarked", "controls"),
    *("saliency_rank", "plugins", "published", "files", "meshes", "real", "methods", "attacks", "published_names"),
    *("imperceptibility", "gallery"),
)


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
        raise SpecError(f"no campaign is called {name!r}; {advice} A file of your own is named with its ending, .toml")
    return SPECS / f"{name}.toml"


def read_campaign(
    path: str | Path, real: str | Path | None = None, *, only: Collection[str] = (), plugins: Iterable[str | Path] = ()
) -> Campaign:
    """The campaign in a TOML file; ``real`` is a folder of real meshes.

    ``only``: names of the meshes to take, in any case; without any, all. ``plugins`` are files beside those that the
    file names. Errors: SpecError, which names the key, for anything that does not make sense.
    """
    path = Path(path)
    content = _toml(path)
    content.check_keys(_KEYS)
    files = [*(path.parent / file for file in content.texts("plugins")), *plugins]
    loaded = tuple(Plugin.of(file) for file in files)
    load_plugins(loaded)
    return _campaign(content, path, None if real is None else Path(real), only, loaded)


def _toml(path: Path) -> Table:
    try:
        return Table(tomllib.loads(path.read_text(encoding="utf-8")))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise SpecError(f"cannot read the campaign {path.name}: {error}") from None


def _campaign(
    content: Table, path: Path, real: Path | None, only: Collection[str], plugins: tuple[Plugin, ...]
) -> Campaign:
    methods = {name: checked_spec(METHODS, key, spec) for key, name, spec in content.table("methods").items()}
    meshes = wanted_meshes(content, path.parent, real)
    if not methods or not meshes:
        raise SpecError(f"{'meshes' if methods else 'methods'}: a campaign needs one or more")
    cases = tuple(_cases(_attacks(content, path.parent)))
    published = _published(content, path.parent)
    return Campaign(
        title=content.value("title", str, path.stem),
        meshes=chosen(meshes, only),
        methods=methods,
        cases=cases,
        main=one_of("main", content.value("main", str, next(iter(methods))), methods),
        bits=content.numbers("bits", 64, least=1),
        seeds=_seeds(content),
        code=checked_spec(CODES, "code", content.value("code", str, "random")),
        metrics=_metrics(content.value("metrics", list, list(Campaign.metrics))),
        informed=_informed(content, methods),
        wrong_keys=content.number("wrong_keys", 0),
        unmarked=content.number("unmarked", 0),
        controls=content.texts("controls", dict.fromkeys(case.group for case in cases)),
        saliency_rank=content.value("saliency_rank", bool, False),
        gallery=_gallery(content.table("gallery"), meshes, cases) if "gallery" in content else None,
        plugins=plugins,
        published=published,
        published_names=content.names("published_names", keys=_methods_of(published)),
        imperceptibility=content.names("imperceptibility", values=methods),
    )


def _seeds(content: Table) -> tuple[int, ...]:
    """``seeds = 3`` counts them, ``seeds = [3]`` names them."""
    seeds = content.numbers("seeds", 1, least=0)
    return tuple(range(seeds[0])) if content.value("seeds", int | list, 1) == seeds[0] > 0 else seeds


def _attacks(content: Table, folder: Path) -> Table:
    other = content.value("attacks", str | dict, {})
    return (_toml(folder / other) if isinstance(other, str) else content).table("attacks")


def _cases(groups: Table) -> Iterator[Case]:
    for key, group, conditions in groups.items():
        if group in OWN_GROUPS or not isinstance(conditions, dict):
            raise SpecError(f"{key}: should be a table of conditions, and have a name of its own")
        for line, condition, specs in groups.table(group).items():
            chain = specs if isinstance(specs, list) else [specs]
            yield Case(group, condition, tuple(checked_spec(ATTACKS, line, spec) for spec in chain))


def _metrics(specs: list[Any]) -> tuple[str, ...]:
    metrics = tuple(checked_spec(METRICS, "metrics", spec) for spec in specs)
    if len({METRICS.make(spec).name for spec in metrics}) < len(metrics):
        raise SpecError("metrics: one is given twice; a row has one column for each name")
    return metrics


def _informed(content: Table, methods: Mapping[str, str]) -> tuple[str, ...]:
    labels = content.texts("informed", methods)
    for label in labels:
        if not METHODS.make(methods[label]).takes_reference:
            raise SpecError(f"informed: {label!r} ({methods[label]}) has no use for the cover mesh")
    return labels


def _gallery(table: Table, meshes: Collection[str], cases: Iterable[Case]) -> Gallery:
    table.check_keys(("meshes", "attacks", "subject"))
    shown = table.texts("meshes", meshes) or tuple(meshes)[:6]
    attacks = table.texts("attacks", [case.name for case in cases])
    return Gallery(shown, attacks, one_of("gallery.subject", table.value("subject", str, shown[0]), shown))


def _methods_of(published: str) -> Collection[str]:
    return dict.fromkeys(figure.method for figure in figures(published))


def _published(content: Table, folder: Path) -> str:
    name = content.value("published", str, "")
    try:
        return (folder / name).read_text(encoding="utf-8") if name else ""
    except (OSError, UnicodeDecodeError) as error:
        raise SpecError(f"published: cannot read {name!r}: {error}") from None
