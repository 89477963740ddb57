"""Sources in commands: which count (``--without``), those beyond the law, and files of them that are written."""

import contextlib
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rig.atomic_files import replacing
from rig.exceptions import RigError, on_one_line, quoted
from rig.read_limits import parse_json
from uq.analysis.propagation.uncovered_sources import BeyondLawError
from uq.cli.terminal.command_parser import CommandParser
from uq.experiment.experiment import Experiment
from uq.files.toml_text import toml_text


def add_without_option(parser: CommandParser) -> None:
    """Add ``--without``; :meth:`uq.experiment.experiment.Experiment.without_source` takes ``without``."""
    parser.value(
        "--without", "SOURCE", action="append", default=[],
        text="leave out a source, by its name or kind, such as coloured; repeatable",
    )  # fmt: skip


def new_sources_file(name: str | None) -> Path | None:
    """Return the path of ``-o``, to which sources are to be written; None: to none.

    Raises:
        RigError: it exists.
    """
    if name is not None and os.path.lexists(name):
        raise RigError(f"{quoted(name)} exists: give another name to -o")
    return None if name is None else Path(name)


def write_sources(output: Path | None, content: Mapping[str, Any]) -> None:
    """Write a file that an experiment includes, and say how; None: nothing is written.

    Raises:
        RigError: it exists, having appeared meanwhile.
    """
    if output is not None:
        with replacing(output) as file:
            file.write(toml_text(content).lstrip().encode())
        print()
        print(on_one_line(f'{output} is written; use it in an experiment: include = ["{output.name}"]'))


@contextlib.contextmanager
def shares_named(experiment: Experiment, folder: Path | None) -> Iterator[None]:
    """Add shares to the message on sources that the law does not take, where a Monte Carlo of the file is in a folder.

    Raises:
        BeyondLawError: with the shares.
    """
    try:
        yield
    except BeyondLawError as error:
        raise BeyondLawError(error.reasons, _shares(experiment, folder)) from None


def _shares(experiment: Experiment, folder: Path | None) -> dict[str, float]:
    """Return each source's share of the 3σ by itself, averaged over components; the largest of all estimators."""
    shares: dict[str, float] = {}
    if folder is None:
        return shares
    with contextlib.suppress(OSError, ValueError, KeyError, TypeError, AttributeError):  # no result, or another's
        content = parse_json((folder / "result.json").read_text("utf-8"))
        if content["provenance"]["experiment_file"]["sha256"] != experiment.file["sha256"]:
            return {}
        for breakdowns in content["trajectories"].values():
            for breakdown in breakdowns.values():
                total = _widths(breakdown["groups"]["total"])
                for name, alone in breakdown["sources"].items():
                    share = float(np.mean(_widths(alone) / total))
                    shares[name] = max(share, shares.get(name, 0.0))
    return shares


def _widths(figures: Mapping[str, Any]) -> np.ndarray:
    return np.array(list(figures["three_sigma"].values()), float)
