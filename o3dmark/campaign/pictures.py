"""What a report shows and no row can say: DIR/pictures/*.jpg, and DIR/pictures.json, a list of what they are.

    saliency             the cover, coloured by its saliency
    original             the cover
    marked               the marked mesh
    attacked             the marked mesh after a case: its group and condition
    attacked saliency    the same, coloured by its own saliency; after "no attack": the marked mesh

are the kinds. The last two are of the gallery's subject alone.
"""

import hashlib
import json
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from o3dmark.arrays import Floats
from o3dmark.campaign.plan import UNTOUCHED, Case, Job
from o3dmark.campaign.specimen import Specimen
from o3dmark.files import replacing
from o3dmark.view import jpeg, render

LIST, FOLDER = "pictures.json", "pictures"
SIZE = (360, 330)  # pixels


@dataclass(frozen=True)
class Picture:
    """A JPEG file's bytes, and what they show."""

    mesh: str
    kind: str
    group: str
    condition: str
    caption: str
    jpeg: bytes

    @property
    def file(self) -> str:
        """Its path in the campaign's folder."""
        names = (self.mesh, self.kind, self.group, self.condition)
        readable = re.sub(r"[^a-z0-9]+", "-", " ".join(names).lower()).strip("-")
        return f"{FOLDER}/{readable}-{hashlib.sha256(json.dumps(names).encode()).hexdigest()[:6]}.jpg"

    def entry(self) -> dict[str, str]:
        """Its line in the list."""
        told = {"mesh": self.mesh, "kind": self.kind, "group": self.group, "condition": self.condition}
        return {"file": self.file} | told | {"caption": self.caption}


def pictures_of(job: Job, made: Specimen, case: Case, mesh: Any, saliency: Floats) -> Iterator[Picture]:
    """The pictures after one case, of ``mesh`` and its ``saliency`` (n,); before any attack, cover and mark too."""
    untouched = case.group == UNTOUCHED
    if untouched:
        vertices = f"{len(made.cover.vertices):,} vertices"
        yield _picture(job, "saliency", case, made.cover, made.saliency, caption=vertices)
        yield _picture(job, "original", case, made.cover)
        yield _picture(job, "marked", case, made.marked, frame=made.cover)
    if job.subject:
        if not untouched:
            yield _picture(job, "attacked", case, mesh)
        yield _picture(job, "attacked saliency", case, mesh, saliency)


def save_pictures(directory: str | Path, pictures: Sequence[Picture], meshes: Iterable[str]) -> None:
    """Add pictures to a folder; its list is in the order of ``meshes``, the campaign's."""
    if not pictures:
        return
    directory, rank = Path(directory), {name: number for number, name in enumerate(meshes)}
    (directory / FOLDER).mkdir(exist_ok=True)
    for picture in pictures:
        with replacing(directory / picture.file) as draft:
            draft.write_bytes(picture.jpeg)
    old = json.loads((directory / LIST).read_text(encoding="utf-8")) if (directory / LIST).exists() else []
    known = {entry["file"]: entry for entry in [*old, *(picture.entry() for picture in pictures)]}
    entries = sorted(known.values(), key=lambda entry: rank.get(entry["mesh"], len(rank)))
    with replacing(directory / LIST) as draft:
        draft.write_text(json.dumps(entries, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def _picture(
    job: Job, kind: str, case: Case, mesh: Any, scalars: Floats | None = None, *, frame: Any = None, caption: str = ""
) -> Picture:
    image = render(mesh, scalars, size=SIZE, frame=frame)
    return Picture(job.mesh.name, kind, case.group, case.condition, caption, jpeg(image))
