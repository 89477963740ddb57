"""The mounting of the body in each run: the runs' own word, or that of ``--mounting``."""

from collections.abc import Sequence
from dataclasses import replace

from identify.signals.run import Run, RunError


def names(text: str) -> tuple[str, ...]:
    """Return the names of ``--mounting``, separated by commas.

    Raises:
        RunError: one of them is empty.
    """
    mountings = tuple(word.strip() for word in text.split(","))
    if not all(mountings):
        raise RunError(f"--mounting is '{text}': give a name for each run, separated by commas, such as A,A,B")
    return mountings


def check_count(mountings: Sequence[str] | None, runs: int) -> None:
    """Refuse names of mountings that are not one a run.

    Raises:
        RunError: there are more or fewer.
    """
    if mountings is not None and len(mountings) != runs:
        raise RunError(f"--mounting names {len(mountings)} mountings for {runs} runs: give one name a run")


def labelled(runs: Sequence[Run], mountings: Sequence[str] | None) -> list[Run]:
    """Return the runs with the names of their mountings.

    Args:
        runs: the runs, which may name their own.
        mountings: one name a run; None: the runs' own.

    Raises:
        RunError: not one name a run, or some runs name their mounting and others do not.
    """
    if mountings is not None:
        check_count(mountings, len(runs))
        return [replace(run, mounting=name) for run, name in zip(runs, mountings, strict=True)]
    silent = [run.name for run in runs if run.mounting is None]
    if 0 < len(silent) < len(runs):
        raise RunError(f"{silent[0]} does not name its mounting, others do: name one for every run by --mounting")
    return list(runs)
