"""``include`` of an experiment file: sources that stand in files of their own."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rig.exceptions import RigError, quoted
from uq.files.document import read_document
from uq.files.mistakes import ExperimentError

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
    sources = list(document.get("source", [])) if isinstance(document.get("source", []), list | tuple) else []
    origin = {source.get("name"): "the experiment" for source in sources if isinstance(source, Mapping)}
    for path in paths:
        for source in _sources(path, folder):
            name = source.get("name")
            if name in origin:
                raise ExperimentError(
                    f"source {quoted(str(name))} is declared twice, in {origin[name]} and in {path}: keep one"
                )
            origin[name] = path
            sources.append(source)
    others = {key: value for key, value in document.items() if key != "include"}
    return {**others, "source": sources} if paths else others


def _sources(path: str, folder: Path) -> list[dict[str, Any]]:
    """The sources of a file; those that name a file beside theirs name it from the experiment's folder."""
    try:
        document, _ = read_document(folder / path, "a file of [[source]] tables")
    except (OSError, RigError):
        raise ExperimentError(f"no file {quoted(path)}, which include names: `inertia noise -o` writes one") from None
    sources = document.pop("source", [])
    if (
        document
        or not sources
        or not isinstance(sources, list)
        or not all(isinstance(source, dict) for source in sources)
    ):
        what = ", ".join(sorted(document)) or "no [[source]]"
        raise ExperimentError(f"{path} holds {what}: a file that include names holds [[source]] tables alone")
    below = Path(path).parent
    return [s | {SAMPLES: str(below / s[SAMPLES])} if isinstance(s.get(SAMPLES), str) else s for s in sources]
