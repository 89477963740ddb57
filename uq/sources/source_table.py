"""``[[source]]`` of an experiment file and of those that it includes -> sources with the distributions of their draws.

With ``[[correlation]]`` also what is correlated; and sources of a file's content changed or left out.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from rig.exceptions import RigError, listed, quoted
from rig.read_limits import require_file
from rig.toml_tables import Name, TomlError, TomlTable, WrongKeyError, item_label, read_table, read_value
from uq.files.document import read_document, with_keys
from uq.files.mistakes import ExperimentError
from uq.files.schema import matrix
from uq.files.units import UnitError, scale
from uq.sources.correlations import LinkTable, check_correlated, check_correlation, link_of, mixing_of
from uq.sources.datasheet import FULL_SCALE, datasheet
from uq.sources.distributions import BETWEEN_LIMITS, Bounded, Distribution, Empirical, Normal, StudentT
from uq.sources.draw_figures import DrawFigures, part_of
from uq.sources.draws import Mixing, stream_number
from uq.sources.source import KINDS, ErrorKind, Source


class SourceTable(TomlTable, frozen=True, kw_only=True):
    """``[[source]]``: a source of error; its other keys depend on target and kind."""

    name: Name
    """Name of the source in results and correlations, by which its random stream is keyed."""
    group: Name
    """Group in which the source counts, such as load_cell."""
    reference: str = ""
    """Publication or document from which the source's figures come."""


class DrawTable(SourceTable, frozen=True, kw_only=True):
    """Keys of a source that is drawn, to which each kind adds sizes in the unit of its target."""

    distribution: Literal["normal", "rectangular", "triangular", "u_shaped", "student_t", "samples"] | None = None
    """Distribution of the draw; missing: normal."""
    degrees_of_freedom: float | None = None
    """Degrees of freedom of the stated width; missing: infinite."""
    datasheet: str | tuple[str, ...] | None = None
    """A datasheet's statement, for all axes or one for each, such as "±0.5 % of full scale, k = 2"."""
    samples: str | None = None
    """Name of a file of samples beside the experiment."""
    unit: str | None = None
    """Name of the unit of a file of samples."""


SIZES = {
    "sigma": "Standard deviation of the draw.",
    "half_width": "Half the width of a distribution between limits.",
    "scale": "Scale of Student's t.",
    "full_scale": "Full scale to which the per cent of a datasheet refer.",
    "mean": "Expectation of the draw: a known effect that is not corrected.",
    "correlation": "Correlation matrix of the draw's axes.",
}
"""Meaning of the keys that are in the unit of the erroneous quantity."""


def draw_keys(kind: ErrorKind, target: str) -> list[tuple[str, Any, None]]:
    """Return the fields that a source of a kind adds to :class:`DrawTable`: those in the unit of its target."""
    axes, figures = math.prod(kind.shape), kind.figures(target)
    forms = dict.fromkeys(("sigma", "half_width", "scale"), figures.annotation(least=0))
    forms |= {"full_scale": figures.full_scale()}
    forms |= {} if kind.noise else {"mean": figures.annotation()}
    forms |= {"correlation": matrix(axes, axes)} if axes > 1 else {}
    return [
        (key, Annotated[np.ndarray, form, msgspec.Meta(description=SIZES[key])] | None, None)
        for key, form in forms.items()
    ]


@cache
def source_table(target: str, name: str) -> Any:
    """Return the declaration of ``[[source]]`` for a kind of error on a target."""
    kind = KINDS[target, name]
    base, drawn = (DrawTable, draw_keys(kind, target)) if kind.constant or kind.white else (SourceTable, [])
    hints = kind.keys(target).items()
    undrawn = [(key, hint, None) if type(None) in get_args(hint) else (key, hint) for key, hint in hints]
    keys = [("target", Literal[target]), ("kind", Literal[name]), *undrawn, *drawn]
    return msgspec.defstruct(f"{target}_{name}", keys, bases=(base,), frozen=True, kw_only=True)


WAYS = ("distribution", "degrees_of_freedom", "datasheet", "samples", "unit")
WIDTHS = ("sigma", "half_width", "scale", "datasheet", "samples")
NO_FULL_SCALE = (
    "write this limit over the run's largest reading as '±… % of reading'; "
    'or as a zero, kind = "bias" with full_scale'
)
MOST_ROWS = 100_000
"""Rows of a file of samples."""


def with_distribution(source: Source, table: Any, folder: Path) -> Source:
    """Return a source with the distribution of its draw, ``mean + sigma * shape``, as its table states it.

    Args:
        source: of a kind that is drawn, without a distribution so far.
        table: its keys, a :class:`DrawTable` with :func:`draw_keys`.
        folder: where files of samples are.

    Raises:
        WrongKeyError: keys that do not go together, or a file of samples that cannot be used.
    """
    given = [key for key in WIDTHS if getattr(table, key) is not None]
    if len(given) > 1:
        raise WrongKeyError(given[0], "leave one out", f"and {given[1]} both state the width")
    key = given[0] if given else ""
    if key == "samples":
        drawn = _from_samples(source, table, folder)
    else:
        drawn = (_from_datasheet if key == "datasheet" else _from_keys)(source, table)
    if source.noise or (stated := getattr(table, "mean", None)) is None:
        return drawn
    return replace(drawn, mean=np.asarray(drawn.mean + _figures(source).placed(stated, table.full_scale)))


def _figures(source: Source) -> DrawFigures:
    return source.error_kind.figures(source.target)


def _refuse_others(table: Any, *keys: str) -> None:
    """Refuse what has no meaning beside the way in which the width is stated."""
    for key in (*WAYS, "half_width", "scale", "full_scale"):
        if getattr(table, key) is not None and key not in keys:
            raise WrongKeyError(key, "leave it out", "has no meaning here")


def _from_keys(source: Source, table: Any) -> Source:
    kind, distribution = source.error_kind, table.distribution or "normal"
    if distribution == "samples":
        raise WrongKeyError("samples", "name the file")
    key, ratio, nu = "sigma", 1.0, _freedom(table, needed=distribution == "student_t")
    shape: Distribution = Normal(0.0, 1.0, nu)
    if distribution == "student_t":
        key, shape = "scale", StudentT(0.0, 1.0, nu)
    elif distribution != "normal":
        bounded: Any = BETWEEN_LIMITS[distribution]
        shape = bounded(-bounded.ratio, bounded.ratio, nu)
        key, ratio = ("half_width", bounded.ratio) if table.half_width is not None else ("sigma", 1.0)
    figure = getattr(table, key)
    if figure is None and table.half_width is not None:
        advice = f"add one ({', '.join(BETWEEN_LIMITS)})"
        raise WrongKeyError(key, advice, "is missing; half_width needs a distribution between limits")
    if figure is None:
        raise WrongKeyError(key, "add it")
    in_full_scale = ("full_scale",) if figure.shape != kind.shape else ()
    _refuse_others(table, key, "distribution", "degrees_of_freedom", *in_full_scale)
    return _drawn(source, _figures(source).placed(figure, table.full_scale) / ratio, shape)


def _drawn(source: Source, sigma: ArrayLike, shape: Distribution) -> Source:
    """Return the source, drawn about zero."""
    return replace(source, sigma=np.asarray(sigma), mean=np.zeros(source.error_kind.shape), shape=shape)


def _freedom(table: DrawTable, *, needed: bool) -> float:
    freedom = table.degrees_of_freedom
    if freedom is None and needed:
        raise WrongKeyError("degrees_of_freedom", "add it")
    if freedom is not None and freedom <= 0:
        raise WrongKeyError("degrees_of_freedom", "write more than zero")
    return np.inf if freedom is None else freedom


def _from_datasheet(source: Source, table: Any) -> Source:
    """One statement for all axes, or one for each."""
    for key in ("distribution", "degrees_of_freedom"):
        if getattr(table, key) is not None:
            raise WrongKeyError(key, "leave it out", "is said by the datasheet's figure")
    written = _figures(source)
    is_scale = source.error_kind.shape == (3,) and written.unit == "%"
    _refuse_others(table, "datasheet", *(() if is_scale else ("full_scale",)))
    wholes, unit = written.wholes(table.full_scale), written.unit
    texts = table.datasheet if isinstance(table.datasheet, tuple) else (table.datasheet,) * len(wholes)
    if is_scale and any(FULL_SCALE.search(text) for text in texts):
        problem = "is in % of full scale, and a scale error is in % of the reading"
        raise WrongKeyError("datasheet", NO_FULL_SCALE, problem)
    if len(texts) != len(wholes):
        raise WrongKeyError("datasheet", "write one statement, or one for each axis")
    reading = 100.0 if unit == "%" else None
    try:
        stated = [datasheet(t, unit, full_scale=w, reading=reading) for t, w in zip(texts, wholes, strict=True)]
    except UnitError as error:
        raise WrongKeyError("datasheet", "", str(error)) from None
    scales, shapes = zip(*map(_standard, stated), strict=True)
    if len({(type(shape), float(shape.degrees_of_freedom)) for shape in shapes}) > 1:
        raise WrongKeyError("datasheet", "write a source for each", "states several distributions")
    return _drawn(source, written.placed(np.array(scales) * part_of(unit), table.full_scale), shapes[0])


def _standard(distribution: Distribution) -> tuple[float, Distribution]:
    """Scale and shape of a distribution about zero."""
    if isinstance(distribution, StudentT):
        return float(distribution.scale), StudentT(0.0, 1.0, distribution.degrees_of_freedom)
    shape: Distribution = Normal(0.0, 1.0)
    if isinstance(distribution, Bounded):
        shape = type(distribution)(-distribution.ratio, distribution.ratio)
    return float(distribution.standard_deviation), shape


def _from_samples(source: Source, table: Any, folder: Path) -> Source:
    kind, unit = source.error_kind, source.error_kind.targets[source.target]
    if table.distribution != "samples":
        problem = None if table.distribution is None else 'is not "samples" but samples are given'
        raise WrongKeyError("distribution", "leave one out" if problem else "add it", problem)
    _refuse_others(table, "samples", "distribution", "unit")
    if table.unit is None:
        raise WrongKeyError("unit", "add it")
    rows, axes = _read_samples(table, folder), math.prod(kind.shape)
    if rows.shape[1] not in (1, axes):
        raise WrongKeyError("samples", f"give 1, or {axes}, one per axis", f"has {rows.shape[1]} columns")
    try:
        rows = rows * (scale(table.unit, unit) * part_of(unit))
    except UnitError as error:
        raise WrongKeyError("unit", "", str(error)) from None
    mean, sigma = rows.mean(axis=0), rows.std(axis=0)
    standard = (rows - mean) / np.where(sigma > 0, sigma, 1)
    shape = Empirical(standard if standard.shape[1] > 1 else standard[:, 0])
    sigma, mean = (np.broadcast_to(value, axes).reshape(kind.shape).copy() for value in (sigma, mean))
    drawn = _drawn(source, sigma, shape)
    return drawn if source.noise else replace(drawn, mean=mean)


def _read_samples(table: Any, folder: Path) -> np.ndarray:
    try:
        require_file(folder / table.samples)
        text = (folder / table.samples).read_text("utf-8")
    except (OSError, UnicodeDecodeError, ValueError):
        raise WrongKeyError("samples", "not a readable file beside the experiment; correct the name") from None
    lines = [line.split("#")[0].replace(",", " ").split() for line in text.splitlines()]
    try:
        rows = np.array([[float(item) for item in line] for line in lines if line])
    except ValueError:
        raise WrongKeyError("samples", "write numbers, the same count in every line") from None
    if rows.ndim != 2 or not 2 <= len(rows) <= MOST_ROWS or not np.isfinite(rows).all():
        raise WrongKeyError("samples", f"give 2 to {MOST_ROWS:,} lines of finite numbers")
    return rows


def read_source(path: str, raw: Any) -> Any:
    """Return the values of a ``[[source]]``, a :class:`SourceTable` with the keys of its kind on its target.

    Raises:
        TomlError: a mistake in its keys.
    """
    if not isinstance(raw, Mapping):
        raise TomlError(f"{path} is {quoted(raw)}: write a table")
    target = _word(path, raw, "target", {target for target, _ in KINDS})
    name = _word(path, raw, "kind", {name for _, name in KINDS})
    kind = KINDS.get((target, name))
    if kind is None:
        allowed = sorted(other.name for other in set(KINDS.values()) if other.targets.get(target))
        advice = f'{target} is one draw an experiment, write "bias"'
        if allowed != ["bias"]:
            advice = f"for {target} choose one of {', '.join(allowed)}"
        raise TomlError(f"{path}.kind is '{name}': {advice}")
    return read_table(path, raw, source_table(target, name))


def _word(path: str, raw: Mapping[str, Any], key: str, words: set[str]) -> str:
    if key not in raw:
        raise TomlError(f"missing key {path}.{key}: add it")
    return read_value(f"{path}.{key}", raw[key], Literal[tuple(sorted(words))])


def sources_of(
    tables: Sequence[Any], written: Sequence[Mapping[str, Any]], correlations: Sequence[LinkTable], folder: Path
) -> tuple[tuple[Source, ...], tuple[Mixing, ...]]:
    """Return the sources of an experiment file, and what is correlated.

    Args:
        tables: its ``[[source]]``, each read by :func:`read_source`.
        written: the same as they stand in the file.
        correlations: its ``[[correlation]]``.
        folder: where files of samples are.

    Raises:
        ExperimentError: a mistake in either.
    """
    sources, of_axes = dict[str, Source](), dict[str, np.ndarray]()
    for table, raw in zip(tables, written, strict=True):
        where = f"source[{item_label(len(sources), raw)}]"
        try:
            source = _source(table, folder)
        except WrongKeyError as error:
            raise ExperimentError(error.line(where, raw)) from None
        if (matrix := getattr(table, "correlation", None)) is not None:
            check_correlated(f"{where}.correlation", source)
            check_correlation(f"{where}.correlation", matrix)
            of_axes[source.name] = matrix
        sources[source.name] = source
    _check_names([table.name for table in tables], {table.group for table in tables})
    links = [link_of(f"correlation[{k}]", link, sources) for k, link in enumerate(correlations)]
    return tuple(sources.values()), mixing_of(tuple(sources.values()), of_axes, links)


def _source(table: Any, folder: Path) -> Source:
    kind = KINDS[table.target, table.kind]
    source = Source(
        name=table.name, target=table.target, kind=table.kind, group=table.group, reference=table.reference,
        sigma=np.zeros(0), mean=np.zeros(0),
    )  # fmt: skip
    if kind.constant or kind.white:
        source = with_distribution(source, table, folder)
    settings = kind.settings({key: getattr(table, key) for key in kind.keys(table.target)})
    if table.group == "total":
        raise WrongKeyError("group", "write another name", "is 'total', which means all sources")
    return replace(source, settings=settings)


def _check_names(names: Sequence[str], groups: set[str]) -> None:
    """Refuse names that would be mistaken for one another: a source's for a group's, or two of one random stream."""
    streams = {stream_number(name): name for name in names}
    for name in names:
        if names.count(name) > 1:
            raise ExperimentError(f"two entries named '{name}' in [[source]]: give each its own name")
        if name in groups:
            raise ExperimentError(f"'{name}' names a source and a group: rename one")
        if (other := streams[stream_number(name)]) != name:
            raise ExperimentError(f"sources '{name}' and '{other}' have one random stream: rename one")


SAMPLES = "samples"
"""Key of a source that names a file, beside the one in which it stands."""


def with_included(document: Mapping[str, Any], folder: Path) -> Mapping[str, Any]:
    """Return the content of an experiment with the sources of the files that it includes, and without ``include``.

    Args:
        document: content of an experiment file.
        folder: of that file, from which the paths count.

    Raises:
        ExperimentError: a file is missing, is no TOML or holds more than sources, or a source stands in two files.
    """
    paths = document.get("include", [])
    if not isinstance(paths, list | tuple) or not all(isinstance(path, str) for path in paths):
        raise ExperimentError(f'include is {quoted(str(paths))}: write a list of files, include = ["sources.toml"]')
    if not paths:
        return document
    both = {key: value for key, value in document.items() if key != "include"}
    both |= {key: list(value) for key in INCLUDED if isinstance(value := document.get(key, []), list | tuple)}
    origin = {str(source.get("name")): "the experiment" for source in both["source"] if isinstance(source, Mapping)}
    for path in paths:
        tables = _included(path, folder)
        for name in (str(source.get("name")) for source in tables["source"]):
            if name in origin:
                raise ExperimentError(
                    f"source {quoted(name)} is declared twice, in {origin[name]} and in {path}: keep one"
                )
            origin[name] = path
        both |= {key: [*both[key], *tables.get(key, [])] for key in INCLUDED}
    return {key: value for key, value in both.items() if key not in INCLUDED or key == "source" or value}


INCLUDED = ("source", "correlation", "calibration")
"""Tables that an included file may hold."""


def _included(path: str, folder: Path) -> dict[str, list[dict[str, Any]]]:
    """The tables of a file; sources that name a file beside theirs name it from the experiment's folder."""
    try:
        document, _ = read_document(folder / path, "a file of [[source]] tables")
    except (OSError, RigError):
        raise ExperimentError(
            f"no file {quoted(path)}, which include names: `inertia noise -o` or `inertia calibrate -o` writes one"
        ) from None
    tables = {key: document.pop(key) for key in INCLUDED if key in document}
    wrong = any(not isinstance(t, list) or not all(isinstance(s, dict) for s in t) for t in tables.values())
    if document or not tables.get("source") or wrong:
        what = ", ".join(sorted(document)) or "no [[source]]"
        raise ExperimentError(f"{path} holds {what}: a file that include names holds [[source]] tables alone")
    below = Path(path).parent
    tables["source"] = [
        s | {SAMPLES: str(below / s[SAMPLES])} if isinstance(s.get(SAMPLES), str) else s for s in tables["source"]
    ]
    return tables


WIDTH_KEYS = ("distribution", "degrees_of_freedom", "unit")
"""Keys beside a width that is replaced by one of another kind, such as a datasheet's statement by a sigma."""


def changed_source(entry: Mapping[str, Any], keys: Mapping[str, Any]) -> dict[str, Any]:
    """Return a source's keys with others in their place.

    A width, such as ``sigma``, takes the place of any other, such as ``datasheet``, and of the keys that go with that.
    """
    both = {**entry, **keys}
    kind = KINDS.get((str(both.get("target")), str(both.get("kind"))))
    is_vector = kind is not None and kind.shape == (3,)
    before = {key for key in WIDTHS if key in entry}
    left_out: dict[str, None] = {}
    if before and set(keys) & set(WIDTHS) - before:
        datasheet_keys = ("full_scale",) if is_vector and "datasheet" in before else ()
        left_out = dict.fromkeys((*before, *WIDTH_KEYS, *datasheet_keys))
    return with_keys(entry, {**left_out, **keys})


def without_sources(
    document: Mapping[str, Any], sources: Sequence[Source], which: Sequence[str]
) -> tuple[dict[str, Any], list[str]]:
    """Return the content without the sources of some names or kinds and what correlates them, and their names.

    A name may have spaces for its underscores, as tables print it.

    Raises:
        ExperimentError: no source has such a name or kind.
    """
    names_by_word: dict[str, list[str]] = {}
    for source in sources:
        for word in (source.name, source.kind):
            names_by_word.setdefault(word.replace(" ", "_"), []).append(source.name)
    left_out: dict[str, None] = {}
    for wanted in which:
        names = names_by_word.get(wanted.replace(" ", "_"))
        if names is None:
            named, kinds = (dict.fromkeys(getattr(s, key) for s in sources) for key in ("name", "kind"))
            choices = f"choose a name of [[source]] ({listed(named)}) or a kind ({listed(kinds)})"
            raise ExperimentError(f"no source to leave out has the name or kind {quoted(wanted)}: {choices}")
        left_out |= dict.fromkeys(names)
    links = [link for link in document.get("correlation", []) if not left_out.keys() & set(link["sources"])]
    remaining = [source for source in document.get("source", []) if source["name"] not in left_out]
    return with_keys(document, {"source": remaining, "correlation": links or None}), list(left_out)
