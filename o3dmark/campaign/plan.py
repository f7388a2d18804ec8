"""What a campaign measures, as pure data, and the jobs that follow from it. The file that says it: `spec_file`."""

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from o3dmark.campaign.plugins import Plugin
from o3dmark.campaign.row import UNMARKED, WRONG_KEY

UNTOUCHED = "no attack"
OWN_GROUPS = (UNTOUCHED, WRONG_KEY, UNMARKED)  # the tables that a campaign adds to those of its attacks


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
    """Attacks applied in order: a line, ``condition``, of the table ``group``."""

    group: str
    condition: str
    attacks: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """As [gallery] names it."""
        return f"{self.group}/{self.condition}"


@dataclass(frozen=True)
class Reading:
    """One row to come: what is done to which mesh, and whose key reads it; no ``key`` is the owner's."""

    case: Case
    control: str = ""
    key: str = ""


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
    unmarked: int = 0
    controls: tuple[str, ...] = ()
    informed: bool = False
    saliency_rank: bool = False
    gallery: tuple[str, ...] | None = None  # cases whose saliency is compared with the cover's; None: no picture either
    subject: bool = False  # the meshes after those cases are drawn too
    plugins: tuple[Plugin, ...] = ()

    @property
    def id(self) -> str:
        """16 hexadecimal digits that any change of the job changes; the folders of files are no part of it.

        What is as its default says is left out, so that a field to come changes no id.
        """
        content = {each.name: value for each in fields(self) if (value := getattr(self, each.name)) != each.default}
        content |= {"mesh": asdict(self.mesh) | {"source": self.mesh.public}}
        content |= {"cases": [asdict(case) for case in self.cases]}
        if self.plugins:
            content["plugins"] = [asdict(plugin.public) for plugin in self.plugins]
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]

    @property
    def readings(self) -> tuple[Reading, ...]:
        """Every reading of the job, a row each; those of one mesh follow each other."""
        return (Reading(Case(UNTOUCHED, "-")), *self._wrong_keys(), *self._attacked(), *self._unmarked())

    def _wrong_keys(self) -> Iterator[Reading]:
        for number in range(1, self.wrong_keys + 1):
            yield Reading(Case(WRONG_KEY, str(number)), WRONG_KEY, f"wrong key {number} of seed {self.seed}")

    def _attacked(self) -> Iterator[Reading]:
        for case in self.cases:
            yield Reading(case)
            if case.group in self.controls:
                yield Reading(case, WRONG_KEY, f"wrong key {case.name} of seed {self.seed}")

    def _unmarked(self) -> Iterator[Reading]:
        for number in range(1, self.unmarked + 1):
            yield Reading(Case(UNMARKED, str(number)), UNMARKED, f"unmarked {number} of seed {self.seed}")
        for case in self.cases:
            if case.group in self.controls:
                yield Reading(case, UNMARKED)


@dataclass(frozen=True)
class Gallery:
    """What is drawn: these meshes, marked by the campaign's main method, and after these cases ("table/condition")."""

    meshes: tuple[str, ...] = ()
    attacks: tuple[str, ...] = ()
    subject: str = ""  # the mesh to show after attacks


@dataclass(frozen=True)
class Campaign:
    """A whole TOML file, checked. Names are those of its tables; what each field means stands in `spec_file`."""

    title: str
    meshes: tuple[Source, ...]
    methods: Mapping[str, str]
    cases: tuple[Case, ...]
    main: str
    bits: tuple[int, ...] = (64,)
    seeds: tuple[int, ...] = (0,)
    code: str = "random"
    metrics: tuple[str, ...] = ("mrms", "hausdorff", "msdm")
    informed: tuple[str, ...] = ()
    wrong_keys: int = 0
    unmarked: int = 0
    controls: tuple[str, ...] = ()
    saliency_rank: bool = False
    gallery: Gallery | None = None
    plugins: tuple[Plugin, ...] = ()
    published: str = ""  # the text of the CSV file
    published_names: Mapping[str, str] = field(default_factory=dict)
    imperceptibility: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> "Campaign":
        """What `to_dict` wrote, after JSON; the folders of files are not known any more."""
        lists = {name: tuple(value) for name, value in content.items() if isinstance(value, list)}
        gallery = content["gallery"]
        return cls(
            **{
                **content,
                **lists,
                "meshes": tuple(Source(**each) for each in content["meshes"]),
                "cases": tuple(Case(**each | {"attacks": tuple(each["attacks"])}) for each in content["cases"]),
                "plugins": tuple(Plugin(**each) for each in content["plugins"]),
                "gallery": gallery and Gallery(tuple(gallery["meshes"]), tuple(gallery["attacks"]), gallery["subject"]),
            }
        )

    def to_dict(self) -> dict[str, Any]:
        """Ready for JSON, without the folders of files."""
        meshes = tuple(replace(mesh, source=mesh.public) for mesh in self.meshes)
        return asdict(replace(self, meshes=meshes, plugins=tuple(plugin.public for plugin in self.plugins)))

    def with_meshes_of(self, other: "Campaign") -> "Campaign":
        """The same with the meshes of another campaign that it lacks."""
        names = {mesh.name for mesh in self.meshes}
        return replace(self, meshes=(*self.meshes, *(mesh for mesh in other.meshes if mesh.name not in names)))

    def jobs(self) -> Iterator[Job]:
        """All jobs, those of one mesh together."""
        for mesh in self.meshes:
            for seed in self.seeds:
                for n_bits in self.bits:
                    for label in self.methods:
                        yield self._job(mesh, seed, n_bits, label)

    def _job(self, mesh: Source, seed: int, n_bits: int, label: str) -> Job:
        drawn = (seed, n_bits, label) == (self.seeds[0], self.bits[0], self.main)
        shown = self.gallery if drawn and self.gallery and mesh.name in self.gallery.meshes else None
        return Job(
            mesh=mesh,
            label=label,
            method=self.methods[label],
            n_bits=n_bits,
            code=self.code,
            seed=seed,
            cases=self.cases,
            wrong_keys=self.wrong_keys,
            metrics=self.metrics,
            unmarked=self.unmarked,
            controls=self.controls,
            informed=label in self.informed,
            saliency_rank=self.saliency_rank,
            gallery=None if shown is None else shown.attacks,
            subject=shown is not None and shown.subject == mesh.name,
            plugins=self.plugins,
        )
