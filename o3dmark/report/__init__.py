"""A campaign's rows as a Markdown file and as one HTML page that needs nothing else.

    write_report     a folder with rows     -> report.md, report.html

The page holds the same tables as the Markdown, and the curves and pictures besides.
"""

from collections.abc import Iterator
from pathlib import Path

from o3dmark.files import replacing
from o3dmark.report.content import Section
from o3dmark.report.curves import curve_sections
from o3dmark.report.data import Results
from o3dmark.report.gallery import gallery_sections
from o3dmark.report.header import facts, tiles
from o3dmark.report.markdown import markdown
from o3dmark.report.page import page
from o3dmark.report.paper import imperceptibility_section, paper_section
from o3dmark.report.published import comparison_sections
from o3dmark.report.tables import failure_section, other_attacks_section, overview_section, wrong_key_section


def write_report(directory: str | Path, *, pictures: bool = True) -> tuple[Path, Path]:
    """Write DIR/report.md and DIR/report.html from DIR's rows; returns both paths.

    ``pictures``: also mark and attack the gallery's meshes anew, and draw them. Errors: SpecError when the folder holds
    no campaign or no row yet.
    """
    results = Results.load(directory)
    sections = [section for section in _sections(results, pictures) if section.blocks]
    texts = {
        "report.md": markdown(results.campaign.title, facts(results), tiles(results), sections),
        "report.html": page(results.campaign.title, facts(results), tiles(results), sections),
    }
    for name, text in texts.items():
        with replacing(Path(directory) / name) as draft:
            draft.write_text(text, encoding="utf-8")
    return Path(directory) / "report.md", Path(directory) / "report.html"


def _sections(results: Results, pictures: bool) -> Iterator[Section]:
    yield overview_section(results)
    yield from curve_sections(results)
    yield paper_section(results)
    yield imperceptibility_section(results)
    yield from comparison_sections(results)
    yield other_attacks_section(results)
    yield wrong_key_section(results)
    if pictures:
        yield from gallery_sections(results)
    yield failure_section(results)


__all__ = ["write_report"]
