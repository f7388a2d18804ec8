"""Published comparisons of several methods, continued with our entries: curves and tables.

Every figure of another method is quoted; none of them was run here.
"""

from collections.abc import Iterator

import numpy as np

from o3dmark.report.content import Cell, Figure, Section, Table, corr_cell, cost_cell, number
from o3dmark.report.cost import TABLE, cost, measure, published
from o3dmark.report.data import Results
from o3dmark.report.drawing import INK, axes_for, corr_axis, corrs, legend_name, line, svg
from o3dmark.report.published import COMPARISON
from o3dmark.report.summary import corr

_STYLES = (("--", "."), (":", "x"), ("-.", "+"), ("--", "1"))  # line and marker of a published method


def comparison_section(results: Results) -> Iterator[Section]:
    """Curves first, then the tables behind them, then what marks cost: on each mesh that both have."""
    pairs = [(group, mesh) for group in results.groups for mesh in results.meshes if _conditions(results, group, mesh)]
    figures = [_curves(results, group, mesh) for group, mesh in pairs if len(_conditions(results, group, mesh)) > 1]
    tables = [_comparison(results, group, mesh) for group, mesh in pairs]
    there = results.published.models(TABLE + COMPARISON)
    tables += [_cost_comparison(results, mesh) for mesh in results.meshes if mesh in there]
    intro = (
        "Broken lines without colour are other methods and the published one, with the figures printed for the mesh"
        " of that name. Ours are measured here; the shades are 95 % bootstrap intervals of their mean over seeds."
    )
    if tables:
        yield Section("Comparison with published methods", intro, (*figures, *tables))


def _conditions(results: Results, group: str, mesh: str) -> list[str]:
    """The conditions of a table for which a comparison on this mesh is printed."""
    return [
        each for each in results.groups[group] if results.published.value(group + COMPARISON, each, mesh) is not None
    ]


def _curves(results: Results, group: str, mesh: str) -> Figure:
    """Corr over strength: theirs as printed, ours on the same mesh."""
    conditions = _conditions(results, group, mesh)
    canvas, axes, x, scaled = axes_for(conditions)
    for count, who in enumerate(results.entries):
        line(axes, x, [corrs(results.of(who, group, each, mesh)) for each in conditions], who.name, count, scaled)
    for count, method in enumerate(results.published.methods(group + COMPARISON)):
        values = [results.published.value(group + COMPARISON, each, mesh, method=method) for each in conditions]
        drawn = np.array([np.nan if value is None else value for value in values])
        style, marker = _STYLES[count % len(_STYLES)]
        name = results.published.name(method)
        axes.plot(x, drawn, color=INK, linewidth=1.4, linestyle=style, marker=marker, label=legend_name(name))
    corr_axis(axes)
    title = f"{group.capitalize()}: {mesh}"
    return Figure(title, svg(canvas, axes, f"comparison {title}"))


def _comparison(results: Results, group: str, mesh: str) -> Table:
    table, conditions = group + COMPARISON, _conditions(results, group, mesh)
    told = results.published
    rows = [
        (
            Cell(f"{told.name(method)}, as published"),
            *(Cell(number(told.value(table, each, mesh, method=method))) for each in conditions),
        )
        for method in told.methods(table)
    ]
    rows += [
        (
            Cell(who.name),
            *(
                corr_cell(corr(results.of(who, group, each, mesh)), told.value(table, each, mesh))
                for each in conditions
            ),
        )
        for who in results.entries
    ]
    return Table(f"{group.capitalize()}: {mesh}", ("mean Corr", *conditions), tuple(rows), folded=True)


def _cost_comparison(results: Results, mesh: str) -> Table:
    table = TABLE + COMPARISON
    metrics = [
        each for each in results.metrics if published(results, table, "", mesh, measure(each).published) is not None
    ]
    names = [measure(metric).published for metric in metrics]
    rows = [
        (
            Cell(f"{results.published.name(method)}, as published"),
            *(Cell(number(published(results, table, "", mesh, name, method))) for name in names),
        )
        for method in results.published.methods(table)
    ]
    for who in results.entries:
        ours = (cost(results, who, metric, mesh) for metric in metrics)
        theirs = (published(results, table, "", mesh, name) for name in names)
        rows.append((Cell(who.name), *map(cost_cell, ours, theirs)))
    head = ("", *(measure(metric).title for metric in metrics))
    return Table(f"Imperceptibility: {mesh}", head, tuple(rows))
