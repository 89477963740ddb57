"""Numbers, tables and figures of every result, for terminal, notebook, JSON, DataFrame and report.

A result is a dataclass that inherits :class:`Result`. It holds data and gives its bare numbers by ``records()``; a view
(:mod:`identify.display.views`) shows it as tables, texts and figures. Where no view is registered, as in a program that
imports :mod:`identify` alone, the table is that of the bare numbers. A method of the result's own goes before its
view's.
"""

import dataclasses
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from functools import cache
from hashlib import sha256
from html import escape
from io import BytesIO
from itertools import takewhile
from typing import TYPE_CHECKING, Any, ClassVar, cast
from urllib.parse import quote

import numpy as np

from identify.display.text_tables import Table, one_line
from identify.display.views import part_of_view
from identify.exceptions import UnknownNameError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, FigureBase, SubFigure
    from pandas import DataFrame


VERSION = 1
"""Version of result files (uq/schemas/result.json), raised when a key leaves or changes its meaning."""
PLACE: ContextVar[Any] = ContextVar("place", default=None)
"""The figure, or part of one, that is filled instead of a new figure; None: a new one is made."""


@contextmanager
def drawn_in(place: "Axes | SubFigure | Figure") -> Iterator[Any]:
    """Let what is drawn meanwhile fill a figure, a part of one, or the place of an empty axes, which is removed."""
    if not hasattr(place, "subplots"):  # an axes, recognised without importing matplotlib
        spec, parent = place.get_subplotspec(), place.figure
        if spec is None:
            raise ValueError("Argument `ax` must be an axes of a grid, as plt.subplots makes them, but stands freely.")
        place.remove()
        place = parent.add_subfigure(spec)
    before = PLACE.set(place)
    try:
        yield place
    finally:
        PLACE.reset(before)


LONGEST_STEM = 100
"""Characters of a file's name that names are written out to; a disk takes 255 bytes, its ending included."""


@dataclass(frozen=True)
class Drawing:
    """A figure that is drawn when it is asked for, so that a result costs no matplotlib."""

    name: str
    """Stem of its files; unique in a result."""
    caption: str
    draw: Callable[[], "FigureBase"]
    animate: Callable[[], bytes] | None = None
    """Makes an SVG that moves, which a page shows in place of the figure; None: the figure stands for itself."""


class Figures(Mapping):  # without type arguments, since a runtime type checker would draw one to see what it is
    """Figures by name: ``result.figures()["budget"]`` is drawn when it is first asked for."""

    def __init__(self, drawings: Sequence[Drawing]) -> None:
        self.drawings = {drawing.name: drawing for drawing in drawings}
        self._draw = cache(self._drawn)

    def _drawn(self, name: str) -> "FigureBase":
        figure: Any = self.drawings[name].draw()

        def png() -> bytes:
            buffer = BytesIO()
            figure.savefig(buffer, format="png")
            return buffer.getvalue()

        figure._repr_png_ = png  # a notebook without %matplotlib inline shows it, too
        return figure

    def __getitem__(self, name: str) -> "Figure":
        if name not in self.drawings:
            raise UnknownNameError(name, self.drawings)
        return cast("Figure", self._draw(name))

    def draw(self, name: str, ax: "Axes | SubFigure | Figure") -> "FigureBase":
        """Draw a figure into another one: in the place of an empty axes, or in a subfigure; return that subfigure.

        ``figure, (left, right) = plt.subplots(1, 2, layout="constrained"); figures.draw("residuals", ax=left)``.

        Raises:
            KeyError: there is none of this name; the message names those that there are.
            ValueError: the axes is no part of a grid.
        """
        if name not in self.drawings:
            raise UnknownNameError(name, self.drawings)
        with drawn_in(ax):
            return self.drawings[name].draw()

    def _ipython_key_completions_(self) -> list[str]:
        return list(self.drawings)

    def __iter__(self) -> Iterator[str]:
        return iter(self.drawings)

    def __len__(self) -> int:
        return len(self.drawings)

    def __repr__(self) -> str:
        return "\n".join(f"{name}: {drawing.caption}" for name, drawing in self.drawings.items())


@dataclass(frozen=True)
class Section:
    """A result's part of a report, in the order in which it is read."""

    title: str
    computed: Sequence[str] = ()
    """Paragraphs on what was computed."""
    findings: Sequence[str] = ()
    """Findings that a reader must not miss: warnings, failures, mean errors beyond the dispersion."""
    not_stated: Sequence[str] = ()
    """Items that nobody has declared or stated, which take a certificate's tick away, but are no warnings."""
    tables: Sequence[Table] = ()
    drawings: Sequence[Drawing] = ()
    details: Sequence[Table] = ()
    """Tables that follow the figures."""
    assumptions: Sequence[str] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)
    front: Any = None
    """Particulars that make it a certificate (``uq.report.certificate``); None: another report."""
    adjustable: Sequence[Mapping[str, Any]] = ()
    """Numbers of tables whose figures a reader can change (:mod:`uq.analysis.propagation.adjustable_law`)."""
    verdict: str = ""
    """Conclusion of the result in a sentence; empty: it depends on whether there are findings."""
    headline: int = 1
    """Number of tables that stand at the top of the section."""


PAGE = "docs/explanation/troubles.md"
"""Page of the documentation with a row for each cause and finding."""


def place_in_docs(label: str) -> str:
    """Return page and anchor of the documentation on a finding."""
    return f"{PAGE}#{label.replace(' ', '-')}"


class Shown:
    """Base of objects that show themselves as tables, in a terminal and in a notebook, through their type's view."""

    hidden: ClassVar[frozenset[str]] = frozenset({"by_trajectory", "checked", "hidden", "notes", "overview", "title"})
    """Names that tab completion leaves out: what tables and reports are made of."""

    def _shown(self, part: str, default: Callable[[Any], Any]) -> Any:
        """A part of the view; ``default`` where the view lacks it, or where there is none."""
        return (part_of_view(type(self), part) or default)(self)

    def title(self) -> str:
        """Return the line above the tables in a terminal or notebook; empty for none."""
        return self._shown("title", lambda _: "")

    def tables(self) -> list[Table]:
        """Return the tables that answer what was asked."""
        return self._shown("tables", bare_tables)

    def overview(self) -> list[Table]:
        """Return the tables that a terminal or notebook shows."""
        return self._shown("overview", lambda _: self.tables())

    def notes(self) -> list[str]:
        """Return the lines below these tables."""
        return self._shown("notes", lambda _: [f"attention: {text}" for text in getattr(self, "warnings", ())])

    def records(self) -> list[dict[str, Any]]:
        """Return the bare numbers, one record a row: texts that name the row first, then its figures."""
        table = self.tables()[0]
        return [dict(zip(table.head, row, strict=True)) for row in table.rows]

    def __repr__(self) -> str:
        tables = "\n\n".join(repr(table) for table in self.overview() if not table.long)
        return "\n".join(text for text in (self.title(), tables, *map(one_line, self.notes())) if text)

    def _repr_html_(self) -> str:
        caption = self.title()
        tables = []
        for table in self.overview():
            shown = dataclasses.replace(table, caption=": ".join(filter(None, (caption, table.caption))))
            tables.append(shown._repr_html_())
            caption = ""
        notes = "".join(f"<li>{escape(text)}</li>" for text in self.notes())
        return "".join(tables) + (f"<ul>{notes}</ul>" if notes else "")

    def __dir__(self) -> list[str]:
        return sorted(set(super().__dir__()) - self.hidden)


class Result(Shown):
    """Base of all results: a result gives its bare numbers by ``records()``, or its ``tables()``."""

    hidden = Shown.hidden | {
        *(
            "computed",
            "details",
            "drawings",
            "file_name",
            "files",
            "form",
            "kind",
            "name",
            "pure",
            "rows",
            "section",
            "unit_of_columns",
        )
    }
    name: str = ""
    """Key of its content in the ``result.json`` of another result that it accompanies."""
    file_name: str = "result.json"
    """The file that holds its content."""
    unit_of_columns: ClassVar[str] = ""
    """Unit of the numbers in ``records()``, which :meth:`to_frame` writes behind each name but the ``pure`` ones."""
    pure: ClassVar[frozenset[str]] = frozenset()
    """Names in ``records()`` of numbers without a unit."""
    kind: str = ""
    """Kind of the file: ``kind`` in uq/schemas/result.json, whose ``version`` is that of :meth:`form`."""

    def form(self) -> dict[str, Any]:
        """Return the first two keys of the file: its kind, and the version of its keys and their meaning."""
        return {"kind": self.kind, "version": VERSION}

    def drawings(self) -> list[Drawing]:
        """Return the figures, not yet drawn, with their captions."""
        return self._shown("drawings", lambda _: [])

    def figures(self) -> Figures:
        """Return the figures by name, each a matplotlib ``Figure`` that is drawn when it is asked for."""
        return Figures(self.drawings())

    def files(self) -> dict[str, bytes]:
        """Return the bytes of files that go with it into a folder, by name."""
        return {}

    def section(self) -> Section:
        """Return its part of a report."""
        return self._shown("section", section_of)

    def summary(self) -> str:
        """Return the answer in short: title, verdict, and the tables at the top of the report, as text.

        Example: ``print(montecarlo(Experiment.load("barreto2016"), trials=100).summary())``.
        """
        section, title = self.section(), self.title()
        parts = [title or section.title, section.verdict, *map(repr, section.tables[: section.headline])]
        return "\n".join(filter(None, parts))

    def to_dict(self) -> dict[str, Any]:
        """Return its content as JSON takes it: arrays as lists, what is not finite as None."""
        return {f.name: plain(getattr(self, f.name)) for f in dataclasses.fields(self) if f.compare}  # type: ignore[arg-type]

    def to_frame(self) -> "DataFrame":
        """Return :meth:`records` as a pandas DataFrame: the leading texts are its index, units stand in its columns."""
        from pandas import DataFrame

        records = self.records()
        first = records[0] if records else {}
        index = [name for name, _ in takewhile(lambda item: isinstance(item[1], str), first.items())]
        if len(index) == len(first):  # texts alone: only the first names the row
            index = index[:1]
        frame = DataFrame.from_records(records, index=index or None)
        unit = f" [{self.unit_of_columns}]" if self.unit_of_columns else ""
        return frame.rename(columns=lambda name: name if name in self.pure else f"{name}{unit}")


def bare_tables(result: Any) -> list[Table]:
    """Return the bare numbers of a result, in the units of its ``records()``, as a table."""
    records = result.records()
    unit = getattr(result, "unit_of_columns", "")
    return [Table(unit, list(records[0]), [list(map(_bare, record.values())) for record in records])]


def _bare(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float | np.floating) else str(value)


def interval_records(result: Any, **columns: Iterable[Any]) -> list[dict[str, Any]]:
    """Return a row for each value of a result: some columns, standard uncertainty and the ends of its intervals."""
    columns["standard_uncertainty"] = result.standard_uncertainty
    for name, ends in (("95", result.interval95), ("_bound", result.conventional_bound)):
        if ends is not None:
            columns |= {f"low{name}": ends[:, 0], f"high{name}": ends[:, 1]}
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def uncaptioned(result: Shown) -> list[Table]:
    """Return a result's tables without their captions, as an overview below a title."""
    return [dataclasses.replace(table, caption="") for table in result.tables()]


def section_of(result: Result, **parts: Any) -> Section:
    """Return a result's part of a report: these parts, else its own title, warnings, tables, drawings."""
    defaults: dict[str, Callable[[], Any]] = {
        "title": lambda: result.title() or type(result).__name__,
        "findings": lambda: getattr(result, "warnings", ()),
        "tables": result.tables,
        "drawings": result.drawings,
        "provenance": lambda: getattr(result, "provenance", {}),
    }
    return Section(**{name: default() for name, default in defaults.items() if name not in parts}, **parts)


def stem(*names: str) -> str:
    """Return a figure's name made of names: unique, short, and no character that leads out of the folder."""
    name = "-".join(quote(name, safe="") for name in names)
    return name if len(name) <= LONGEST_STEM else f"{name[:LONGEST_STEM]}-{sha256(name.encode()).hexdigest()[:8]}"


def plain(value: Any) -> Any:
    """Return a value as JSON takes it; a number that is not finite is None."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if hasattr(value, "_asdict"):
        return plain(value._asdict())
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, (np.ndarray, np.generic)) or hasattr(value, "tolist"):
        return plain(np.asarray(value).tolist())
    return None if isinstance(value, float) and not np.isfinite(value) else value
