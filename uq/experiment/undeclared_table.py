"""The table ``[undeclared]`` of an experiment file: typical figures of errors of the rig that nobody declares."""

from typing import Annotated, Any

import msgspec

from identify.errors.error_model import TypicalSize
from identify.errors.registry import ERRORS
from rig.toml_tables import TomlTable, read_value, written
from uq.files.schema import in_unit, quantity_schema
from uq.sources.draw_figures import part_of


def typical(unit: str) -> msgspec.Meta:
    """Return the annotation of a typical figure, in SI, per cent in parts of one; ``false``: there is no such error."""

    def read(path: str, raw: Any) -> float | None:
        if raw is False:
            return None
        if raw is True:
            raise ValueError(f'is true: write a figure such as "1 {unit}", or false')
        return float(read_value(path, raw, Annotated[float, in_unit(unit, above=0)])) * part_of(unit)

    return written(read, {"anyOf": [quantity_schema(unit), {"const": False}]})


def _key(name: str, size: TypicalSize) -> tuple[str, Any, float | None]:
    described = msgspec.Meta(description=size.about)
    return name, Annotated[float | None, typical(size.key_unit), described], size.figure if size.counts else None


# a key for each error that has a typical size
_Figures: Any = msgspec.defstruct(
    "_Figures",
    [_key(error.name, error.typical) for error in ERRORS.values() if error.typical],
    bases=(TomlTable,), frozen=True, kw_only=True,
)  # fmt: skip


class UndeclaredTable(_Figures, frozen=True, kw_only=True):  # type: ignore[call-arg]
    """``[undeclared]``: typical standard uncertainties of errors that are not declared; false: there is none.

    The conventional bound of a result holds them. docs/how-to/identify.md gives the figures and where they are from.
    """


NONE = UndeclaredTable(**dict.fromkeys(UndeclaredTable.__struct_fields__))
"""``undeclared = "none"``: the experiment declares all errors that there are."""
