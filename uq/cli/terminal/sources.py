"""Choice of the sources that count: ``--without``, and an earlier result's note of those beyond the law."""

import contextlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rig.read_limits import parse_json
from uq.analysis.propagation.uncovered_sources import BeyondLawError
from uq.cli.terminal.command_parser import CommandParser
from uq.experiment.experiment import Experiment


def add_without_option(parser: CommandParser) -> None:
    """Add ``--without``; :meth:`uq.experiment.experiment.Experiment.without_source` takes ``without``."""
    parser.value(
        "--without", "SOURCE", action="append", default=[],
        text="leave out a source, by its name or kind, such as coloured; repeatable",
    )  # fmt: skip


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
