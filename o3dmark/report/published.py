"""Figures that somebody has printed, from the CSV that a campaign names and keeps.

    table,method,metric,condition,model,value
    noise,hamidi,corr,0.05%,Flower,0.97
    noise comparison,cho2007,corr,0.1%,Bunny,0.72
    imperceptibility,hamidi,mrms_e-3,saliency,Flower,0.6

``table``: a table of attacks of the campaign; or its name and "comparison", where several methods stand beside each
other; or "imperceptibility", or "imperceptibility comparison" (condition empty). ``model`` is the name of a mesh of the
campaign. ``metric``: corr, or mrms_e-3, hd_e-3 (thousandths of the diagonal), msdm. The first method of the file is the
one that ours are compared with. Nothing is compared unless table, condition and model are all in the file.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from o3dmark.campaign.published import PublishedFigure, figures
from o3dmark.report.condition import same
from o3dmark.report.summary import mean

COMPARISON = " comparison"  # the end of the names of tables that hold several methods


@dataclass(frozen=True)
class Published:
    """All printed figures that a campaign is compared with; none at all for most campaigns."""

    figures: tuple[PublishedFigure, ...] = ()
    names: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def read(cls, text: str, names: Mapping[str, str]) -> "Published":
        """The CSV as text; ``names`` says how to call its methods. Errors: SpecError with the line's number."""
        return cls(figures(text), names)

    @property
    def method(self) -> str:
        """The method that ours are compared with: the first of the file."""
        return self.figures[0].method if self.figures else ""

    def name(self, method: str) -> str:
        """What to call a method."""
        return self.names.get(method, method)

    def value(
        self, table: str, condition: str, model: str, metric: str = "corr", method: str | None = None
    ) -> float | None:
        """One figure, or None. Conditions are the same when number and unit are: "0.10%" is "0.1%"."""
        wanted = (table, self.method if method is None else method, metric)
        found = (
            figure.value
            for figure in self.figures
            if figure[:3] == wanted and figure.model == model and same(figure.condition, condition)
        )
        return next(found, None)

    def mean_of(self, table: str, condition: str, models: Iterable[str], metric: str = "corr") -> float | None:
        """The mean over those of the models that have the figure; None without any."""
        return mean(self.value(table, condition, model, metric) for model in models)

    def models(self, table: str) -> tuple[str, ...]:
        """The models of a table in its order."""
        return tuple(dict.fromkeys(figure.model for figure in self.figures if figure.table == table))

    def methods(self, table: str) -> tuple[str, ...]:
        """The methods of a table in its order."""
        return tuple(dict.fromkeys(figure.method for figure in self.figures if figure.table == table))
