"""The paper's comparisons with other methods, continued with our contestants: curves and tables.

Every figure for a rival is the paper's; none of them was run here.
"""

from collections.abc import Iterator

import numpy as np

from o3dmark.report.content import Cell, Figure, Section, Table, compared, number
from o3dmark.report.data import Results, corr, mean
from o3dmark.report.drawing import INK, axes_for, corr_axis, corrs, line, svg
from o3dmark.report.paper import METRICS, PAPER

_NAMES = {
    "hamidi": "the paper's method",
    "cho2007": "Cho 2007",
    "zhan2014": "Zhan 2014",
    "rolland2014": "Rolland-Nevière 2014",
    "son2017": "Son 2017",
}
_STYLES = {"hamidi": ("--", "."), "cho2007": (":", "x"), "zhan2014": ("-.", "+")}  # line and marker
_SAME = "Ours are measured here on the same model; the shades are 95 % bootstrap intervals over its seeds."
_OTHERS = (
    "This campaign has none of the models that they were compared on: theirs are means over {theirs}, ours over {ours}."
    " That shows where a method gives way, not by how much one is better than another."
)


def comparison_sections(results: Results) -> Iterator[Section]:
    """Curves first, then the tables behind them, then imperceptibility."""
    meshes = {mesh.name for mesh in results.campaign.meshes}
    groups = [group for group in results.groups if PAPER.models(f"{group} comparison")]
    pairs = [(group, model) for group in groups for model in PAPER.models(f"{group} comparison") if model in meshes]
    figures = [_curves(results, group, (model,), same=True) for group, model in pairs]
    if not pairs:
        figures = [_curves(results, group, PAPER.models(f"{group} comparison"), same=False) for group in groups]
    tables = [_comparison(results, f"{group} comparison", group, model) for group, model in pairs]
    models = (model for model in PAPER.models("imperceptibility comparison") if model in meshes)
    tables += [_cost_comparison(results, model) for model in models]
    others = {model for group in groups for model in PAPER.models(f"{group} comparison")}
    basis = _SAME if pairs else _OTHERS.format(theirs=" and ".join(sorted(others)), ours=", ".join(sorted(meshes)))
    intro = "Broken lines without colour are other methods and the paper's own, with the figures that the paper gives. "
    yield Section("Comparison with published methods", intro + basis, (*filter(None, figures), *tables))


def _curves(results: Results, group: str, models: tuple[str, ...], *, same: bool) -> Figure | None:
    """Corr over strength, theirs on ``models``; ours on those if they are the ``same``, on all meshes otherwise."""
    table, wanted = f"{group} comparison", set(models if same else (mesh.name for mesh in results.campaign.meshes))
    conditions = [each for each in results.groups[group] if PAPER.mean_of(table, each, models) is not None]
    if len(conditions) < 2:
        return None
    canvas, axes, x, scaled = axes_for(conditions)
    for count, who in enumerate(results.contestants):
        samples = [corrs([row for row in results.of(who, group, each) if row["mesh"] in wanted]) for each in conditions]
        line(axes, x, samples, who.name, count, scaled)
    for method in PAPER.methods(table):
        values = [mean(PAPER.value(table, each, model, method=method) for model in models) for each in conditions]
        drawn = np.array([np.nan if value is None else value for value in values])
        style, marker = _STYLES.get(method, ("--", "1"))
        axes.plot(x, drawn, color=INK, linewidth=1.4, linestyle=style, marker=marker, label=_NAMES[method])
    corr_axis(axes)
    title = f"{group.capitalize()}: {models[0]}" if same else group.capitalize()
    return Figure(title, svg(canvas, axes, f"comparison {title}"))


def _comparison(results: Results, table: str, group: str, model: str) -> Table:
    conditions = [each for each in results.groups[group] if PAPER.value(table, each, model) is not None]
    rows = [
        (
            Cell(f"{_NAMES[method]}, as published"),
            *(Cell(number(PAPER.value(table, each, model, method=method))) for each in conditions),
        )
        for method in PAPER.methods(table)
    ]
    rows += [
        (
            Cell(who.name),
            *(
                compared(corr(results.of(who, group, each, model)), PAPER.value(table, each, model))
                for each in conditions
            ),
        )
        for who in results.contestants
    ]
    return Table(f"{group.capitalize()}: {model}", ("Corr", *conditions), tuple(rows), folded=True)


def _cost_comparison(results: Results, model: str) -> Table:
    table, keys = "imperceptibility comparison", ("mrms_e-3", "msdm")
    rows = [
        (
            Cell(f"{_NAMES[method]}, as published"),
            *(Cell(number(PAPER.value(table, "", model, key, method))) for key in keys),
        )
        for method in PAPER.methods(table)
    ]
    for who in results.contestants:
        costs = [(results.cost(who, METRICS[key][0], model), METRICS[key][1], key) for key in keys]
        cells = (
            compared(None if cost is None else factor * cost, PAPER.value(table, "", model, key), low=True)
            for cost, factor, key in costs
        )
        rows.append((Cell(who.name), *cells))
    return Table(f"Imperceptibility: {model}", ("", *(METRICS[key][2] for key in keys)), tuple(rows))
