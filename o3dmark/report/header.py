"""What a reader should know first: how the figures came about, and the few that matter most."""

from o3dmark.report.content import Cell, compared
from o3dmark.report.data import Contestant, Results, corr, mean
from o3dmark.report.paper import both


def facts(results: Results) -> dict[str, str]:
    """Names and values for the report's head."""
    campaign, about = results.campaign, results.about
    versions = sorted({row["version"] for row in results.rows})
    jobs, there = len(list(campaign.jobs())), len({row["job"] for row in results.rows})
    seconds = sum(row["seconds"] or 0.0 for row in results.rows)
    return {
        "command": about.get("command") or "not recorded",
        "date": str(about.get("started", "")),
        "version": "o3dmark " + ", ".join(versions),
        "machine": f"{about.get('machine', '')}, Python {about.get('python', '')}",
        "seeds": ", ".join(map(str, campaign.seeds)),
        "bits": ", ".join(map(str, campaign.bits)),
        "meshes": "; ".join(_mesh_text(results, mesh.name, mesh.public) for mesh in campaign.meshes),
        "readings": f"{len(results.rows)} of {there} jobs" + (f" (of {jobs}: unfinished)" if there < jobs else ""),
        "extraction": f"{seconds / max(1, len(results.rows)):.2f} s on average",
    }


def tiles(results: Results) -> dict[str, Cell]:
    """The headline figures of the campaign's main contestant."""
    who = next((each for each in results.contestants if each.label == results.campaign.main), results.contestants[0])
    shown = {"method": Cell(who.name, results.campaign.methods[who.label])} | _agreement(results, who)
    messages = [row["message_ok"] for row in results.attacked(who) if row["message_ok"] is not None]
    if messages:
        shown["messages read after attacks"] = Cell(
            f"{sum(messages)} of {len(messages)}", "exactly, checked by p-value"
        )
    if strangers := [row["message_read"] for row in results.strangers(who) if row["message_read"] is not None]:
        shown["messages read with a wrong key"] = Cell(f"{sum(strangers)} of {len(strangers)}", "should be none")
    if (mrms := results.cost(who, "mrms")) is not None:
        shown["distortion, MRMS"] = Cell(f"{1e3 * mrms:.2f} · 10⁻³", "of the bounding-box diagonal")
    return shown


def _agreement(results: Results, who: Contestant) -> dict[str, Cell]:
    pairs = [
        both(results, who, group, condition) for group, conditions in results.groups.items() for condition in conditions
    ]
    shown = [(ours, theirs) for rows, theirs in pairs if (ours := corr(rows)) is not None and theirs is not None]
    if not shown:
        return {}
    ours, theirs = mean(ours for ours, _ in shown) or 0.0, mean(theirs for _, theirs in shown) or 0.0
    cell = compared(ours, theirs)
    return {"mean Corr in the paper's tables": Cell(cell.text, f"{cell.remark}, {len(shown)} conditions", cell.tone)}


def _mesh_text(results: Results, name: str, source: str) -> str:
    sizes = {row["vertices"] for row in results.rows if row["mesh"] == name and row["vertices"]}
    size = f", {min(sizes):,} vertices".replace(",", " ").replace("  ", ", ") if sizes else ""
    return f"{name} ({source}{size})"
