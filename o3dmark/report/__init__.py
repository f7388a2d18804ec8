"""A campaign's folder as a Markdown file and as one HTML page that needs nothing else.

    write_report     a folder with rows     -> report.md, report.html

The page holds the same tables as the Markdown, and the curves and pictures besides. A report draws what the folder
holds: rows, the campaign's plan and runs, the figures that it is compared with, pictures. It measures nothing.
"""

from collections.abc import Iterator
from pathlib import Path

from o3dmark.campaign.keeping import SUMMARY
from o3dmark.files import replacing
from o3dmark.report.comparison import comparison_section
from o3dmark.report.content import Section
from o3dmark.report.controls import control_section
from o3dmark.report.cost import cost_section
from o3dmark.report.curves import curve_sections
from o3dmark.report.data import Results
from o3dmark.report.gallery import gallery_sections
from o3dmark.report.header import facts, tiles
from o3dmark.report.markdown import markdown
from o3dmark.report.page import page
from o3dmark.report.sweep import sweep_section
from o3dmark.report.tables import attacks_section, failure_section, meshes_section, overview_section


def write_report(directory: str | Path) -> tuple[Path, Path]:
    """Write DIR/report.md and DIR/report.html; returns both paths.

    Errors: SpecError when the folder holds no campaign or no row yet, or when what it holds is damaged.
    """
    results = Results.load(directory)
    sections = list(_sections(results))
    texts = {
        "report.md": markdown(results.campaign.title, facts(results), tiles(results), sections),
        "report.html": page(results.campaign.title, facts(results), tiles(results), sections),
    }
    for name, text in texts.items():
        with replacing(Path(directory) / name) as draft:
            draft.write_text(text, encoding="utf-8")
    return Path(directory) / "report.md", Path(directory) / "report.html"


def _sections(results: Results) -> Iterator[Section]:
    if not results.rows:
        yield from sweep_section(results.directory / SUMMARY)
        return
    yield from overview_section(results)
    yield from curve_sections(results)
    yield from attacks_section(results)
    yield from meshes_section(results)
    yield from cost_section(results)
    yield from comparison_section(results)
    yield from control_section(results)
    yield from gallery_sections(results)
    yield from failure_section(results)


__all__ = ["write_report"]
