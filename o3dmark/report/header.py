"""What a reader should know first: how the figures came about, and the few that matter most."""

from o3dmark.campaign import Run
from o3dmark.campaign.row import UNMARKED, WRONG_KEY
from o3dmark.report.content import Cell, ber_number, number
from o3dmark.report.cost import cost, measure
from o3dmark.report.data import Results
from o3dmark.report.summary import ber, mean
from o3dmark.report.tables import agreement, share


def facts(results: Results) -> dict[str, str]:
    """Names and values for the report's head."""
    campaign = results.campaign
    several = len(results.runs) > 1
    return {
        **{f"run {count}" if several else "run": run_text(run) for count, run in enumerate(results.runs, start=1)},
        "seeds": ", ".join(map(str, campaign.seeds)),
        "bits": ", ".join(map(str, campaign.bits)),
        "meshes": "; ".join(_mesh_text(results, mesh.name, mesh.public) for mesh in campaign.meshes),
        **(_measured(results) if results.rows else {}),
        **_quoted(results),
    }


def _measured(results: Results) -> dict[str, str]:
    """How many rows there are, by which versions, and how long a reading takes."""
    jobs, there = len(list(results.campaign.jobs())), len({row.job for row in results.rows})
    seconds = mean(row.seconds for row in results.rows)
    return {
        "readings": f"{len(results.rows)} of {there} jobs" + (f" (of {jobs}: unfinished)" if there < jobs else ""),
        "measured by": "o3dmark " + ", ".join(sorted({row.version for row in results.rows})),
        "extraction": f"{number(seconds)} s on average",
    }


def _quoted(results: Results) -> dict[str, str]:
    """Whose figures ours stand beside, if anybody's."""
    methods = dict.fromkeys(figure.method for figure in results.published.figures)
    names = "; ".join(map(results.published.name, methods))
    return {"published figures": f"quoted, of {names}; all others were measured here"} if names else {}


def run_text(run: Run) -> str:
    """Who computed rows: command, date, version, commit, machine."""
    version = f"o3dmark {run.version} ({f'commit {run.commit}' if run.commit else 'no commit'})"
    return f"{run.command}, {run.started}, {version}, {run.machine}, Python {run.python}"


def tiles(results: Results) -> dict[str, Cell]:
    """The headline figures of the method that the campaign calls its own; none where no rows are kept."""
    label, who = results.campaign.main, results.main
    if not results.rows:
        return {}
    if who is None:
        return {"method": Cell(label, "no reading yet")}
    attacked = results.attacked(who)
    over = "in the published tables" if results.compared else "after attacks"
    shown = {
        "method": Cell(who.name, results.campaign.methods[label]),
        f"mean Corr {over}": agreement(results, who),
        "mean BER after attacks": Cell(ber_number(ber(attacked)), "share of bits read wrongly"),
        "messages read after attacks": share(attacked, "message_ok"),
        "messages read with wrong keys": share(results.controls(who, WRONG_KEY), "message_read"),
        "messages read from unmarked meshes": share(results.controls(who, UNMARKED), "message_read"),
    }
    for metric in results.metrics[:1]:
        if (value := cost(results, who, metric)) is not None:
            shown[f"cost, {measure(metric).title}"] = Cell(f"{value:.2f}", "mean over meshes and seeds")
    return {name: cell for name, cell in shown.items() if cell.text != "–"}


def _mesh_text(results: Results, name: str, source: str) -> str:
    sizes = {row.vertices for row in results.rows if row.mesh == name and row.vertices}
    size = f", {min(sizes):,} vertices".replace(",", " ").replace("  ", ", ") if sizes else ""
    return f"{name} ({source}{size})"
