"""The study of troubles: for each, at two sizes, with each method, how far off the answer is and what was said of it.

A cell is one run of tests/helpers/laboratory.py with one trouble of tests/helpers/troubles.py, identified from its file and experiment
as ``inertia identify`` does. Its size shifts some component of plain least squares by 3 (small) or 20 (large) of the
method's standard uncertainties on clean runs, or is the largest that is tried. Every cell becomes a line of JSON as
soon as it is done; cells that the file has already are not done again.

    python -m tests.helpers.trouble_study --runs 2 --troubles cable delay --methods source joint --out out/troubles.jsonl
"""

import argparse
import contextlib
import json
import multiprocessing
import os
import tempfile
import time
from collections import Counter
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tests.helpers.interval_quality import FACTOR
from tests.helpers.laboratory import measure
from tests.helpers.troubles import TROUBLES, size_for

METHODS = ("source", "gls", "joint")
LEVELS = {"small": 3.0, "large": 20.0}
"""Standard uncertainties of the method's clean runs by which plain least squares are shifted."""
CLEAN = "nothing"
FIRST = 500
"""Seed of the first run with a trouble, apart from those of clean runs."""
WRONG = 2.0
"""Half-widths of the interval beyond which an answer that says nothing is silently wrong."""
SUMMARY = {"small": ("covered", "error/u", "warned", "silent"), "large": ("covered", "error/u", "warned", "named")}
"""Columns of the summary at each level."""
COMPONENTS = ("I11", "I12", "I13", "I22", "I23", "I33")


class Cell(NamedTuple):
    """One run, identified by one method."""

    trouble: str
    level: str
    method: str
    seed: int
    still: bool = False
    declared: bool = False
    """Whether the experiment declares the trouble as a source of its size."""

    @classmethod
    def of(cls, row):
        return cls(*(row[name] for name in cls._fields))


def clean_cells(runs, methods=METHODS, stills=(False,)):
    return [Cell(CLEAN, "", method, seed, still) for still in stills for method in methods for seed in range(runs)]


def trouble_cells(names, runs, methods=METHODS, levels=tuple(LEVELS), *, still=False, declared=False):
    """The cells of troubles: those that are declared, only where there is a source for them."""
    return [
        Cell(name, level, method, FIRST + k, still if TROUBLES[name].still is None else TROUBLES[name].still, declared)
        for name in names
        if not declared or TROUBLES[name].sources(1.0)
        for level in levels
        for method in methods
        for k in range(runs)
    ]


def size_of(cell: Cell, u):
    """How large the trouble of a cell is: for its own direction, but where it is declared that of the usual one."""
    trouble = TROUBLES[cell.trouble]
    if trouble.sizes is not None:
        return trouble.sizes[list(LEVELS).index(cell.level)]
    seeds = [FIRST - k for k in (1, 2, 3)] if cell.declared else [cell.seed]
    options = {"still": cell.still, "force_rows": cell.method == "joint"}
    return float(np.median([size_for(trouble, LEVELS[cell.level], u, seed, **options) for seed in seeds]))


def row_of(cell: Cell, u=None) -> dict:
    """Do one cell: all that tables and verdicts need of it."""
    from identify.exceptions import RunError
    from tests.helpers.laboratory_files import identified_files, source

    began = time.process_time()
    row, options, sources = cell._asdict(), {}, []
    if cell.trouble != CLEAN:
        row["size"] = size_of(cell, np.asarray(u))
        options = TROUBLES[cell.trouble].options(row["size"], cell.seed)
        sources = [source(*table) for table in TROUBLES[cell.trouble].sources(row["size"]) if cell.declared]
    run = measure(cell.seed, still=cell.still, **options)
    with tempfile.TemporaryDirectory() as folder:
        try:
            row |= said(identified_files(run, Path(folder), cell.method, sources), run.truth)
        except RunError as refused:
            row |= {"refused": str(refused), "causes": symptoms([str(refused)])}
        except Exception as crashed:  # a study of what goes wrong goes on
            row["crashed"] = repr(crashed)
    return row | {"cpu_seconds": round(time.process_time() - began, 2)}


def said(result, truth) -> dict:
    """Errors, intervals, warnings and causes of a result."""
    low, high = result.interval95.T
    with np.errstate(invalid="ignore", divide="ignore"):
        off = np.abs(truth - (low + high) / 2) / ((high - low) / 2)
    effects = () if result.undeclared is None else result.undeclared.rows
    priced = np.sqrt(sum((np.square(effect.standard_uncertainty[4:]) for effect in effects), np.zeros(6)))
    return {
        "error": (result.inertia - truth).tolist(),
        "u": result.standard_uncertainty.tolist(),
        "off": off.tolist(),
        "off_with_price": (np.abs(result.inertia - truth) / np.hypot((high - low) / 2, 2 * priced)).tolist(),
        "covered": ((low <= truth) & (truth <= high)).tolist(),
        "warnings": list(result.warnings),
        "causes": [verdict.cause for verdict in result.consistency] or symptoms(result.warnings),
    }


SYMPTOMS = {
    "the mass comes to": "mass", "the centre of gravity on": "centre of gravity", "the zero of the gyro": "gyro bias",
    "the delay": "delay", "contradicts cg_motion": "still missed", "the rotation vector": "rotation",
    "IMU and load cell are rotated": "rotation", "the distance of the centre": "still missed", "the zero of the": "drift", "the stamps": "jitter", "gaps in": "drops",
}  # fmt: skip
"""What warnings beside the diagnosis are about."""


def symptoms(warnings):
    """What warnings name, where the diagnosis names nothing."""
    return [name for text in warnings for words, name in SYMPTOMS.items() if words in text]


# --- running ---


def begin():
    """What every process does first."""
    import jax

    from uq.files.compilation_cache import keep_compiled

    os.nice(5)
    keep_compiled()
    jax.config.update("jax_enable_x64", True)


def rows_in(path) -> list[dict]:
    """The cells that a file holds."""
    path = Path(path)
    return [json.loads(line) for line in path.read_text("utf-8").splitlines()] if path.exists() else []


def clean_uncertainty(rows: Iterable[dict], method, still):
    """The mean standard uncertainty of a method's clean runs, (6,)."""
    uncertainties = [
        row["u"] for row in rows
        if row["trouble"] == CLEAN and (row["method"], row["still"]) == (method, still) and "u" in row
    ]  # fmt: skip
    if not uncertainties:
        raise ValueError(f"no clean run of {method}, still = {still}: the sizes are in its uncertainties")
    return np.mean(uncertainties, axis=0).tolist()


def run_cells(cells, path, processes=2) -> list[dict]:
    """Do the cells that are not in the file yet, the clean ones first, and return all of its rows."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    done = {Cell.of(row) for row in rows_in(path)}
    waiting = [cell for cell in dict.fromkeys(cells) if cell not in done]
    needed = dict.fromkeys((cell.method, cell.still) for cell in waiting if cell.trouble != CLEAN)
    for method, still in needed:  # u of four clean runs at the least
        waiting += [cell for cell in clean_cells(4, [method], [still]) if cell not in done and cell not in waiting]
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(processes, context, begin) as pool:
        for clean in (True, False):
            part = [cell for cell in waiting if (cell.trouble == CLEAN) == clean]
            rows = rows_in(path)
            u = {} if clean else {key: clean_uncertainty(rows, *key) for key in needed}
            futures = [pool.submit(row_of, cell, u.get((cell.method, cell.still))) for cell in part]
            for future in as_completed(futures):
                with path.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(future.result()) + "\n")
    return rows_in(path)


# --- what it says ---


def warned(row):
    """Whether anything was said: a warning, or a refusal."""
    return bool(row.get("warnings")) or "refused" in row


def silently_wrong(row):
    """Some component farther off than twice its interval's half-width, or no number at all, and not a word of it."""
    return "crashed" in row or (not warned(row) and not all(value <= WRONG for value in row["off"]))


def beyond_its_price(row):
    """Whether an answer that is silently wrong is so beyond what the errors that are not included are said to add."""
    return silently_wrong(row) and ("crashed" in row or not all(value <= 1 for value in row["off_with_price"]))


def first_cause(row):
    return next(iter(row.get("causes", [])), "refused" if "refused" in row else "–")


def named_right(row):
    """Whether the first cause that was named is one of the trouble's.

    None: it has none that could be named; or nothing was said, and the answer is right (an unknown of the method took it
    up) or does not depend on it (not even its largest size shifts it).
    """
    trouble = TROUBLES[row["trouble"]]
    harmless = max(row.get("off", [0.0])) <= (WRONG if row["size"] >= trouble.most else 1)
    if not trouble.causes or (not warned(row) and harmless):
        return None
    return first_cause(row) in trouble.causes


def groups(rows, *keys):
    """Rows by their values of some keys, in the order in which they come."""
    by = {}
    for row in rows:
        by.setdefault(tuple(row[key] for key in keys), []).append(row)
    return by


def over_u(rows) -> str:
    """Root mean square of the error over u, half the width over 1.96."""
    off = [row["off"] for row in rows if "off" in row]
    return f"{FACTOR * np.sqrt(np.mean(np.square(off))):.2g}" if off else "–"


def clean_table(rows) -> str:
    """Coverage and false alarms of clean runs, by method."""
    lines = [
        "| nothing wrong | runs | covered | worst component | error/u | with a warning | first causes |",
        "|---" * 7 + "|",
    ]
    for (method, still), some in groups((row for row in rows if row["trouble"] == CLEAN), "method", "still").items():
        inside = np.array([row["covered"] for row in some if "covered" in row])
        worst = int(inside.mean(axis=0).argmin())
        lines.append(
            f"| {method}{', still' if still else ''} | {len(some)} | {inside.sum()} of {inside.size} "
            f"| {COMPONENTS[worst]} {inside[:, worst].sum()} of {len(inside)} | {over_u(some)} | {sum(map(warned, some))} "
            f"| {_counted(some)} |"
        )
    return "\n".join(lines)


def table(rows) -> str:
    """A line for each trouble, size and method."""
    lines = [
        "| trouble | size (median) | method | worst error / half-width: median, largest | covered | error/u | warned | first cause "
        "| named right | silently wrong | beyond the price told |",
        "|---" * 11 + "|",
    ]
    troubled = sorted(
        (row for row in rows if row["trouble"] != CLEAN),
        key=lambda row: (list(TROUBLES).index(row["trouble"]), row["declared"], list(LEVELS).index(row["level"]),
                         METHODS.index(row["method"])),
    )  # fmt: skip
    for (name, level, method, still, declared), some in groups(
        troubled, "trouble", "level", "method", "still", "declared"
    ).items():
        off = [np.max(row["off"]) for row in some if "off" in row]
        worst = f"{np.median(off):.2g}, {max(off):.2g}" if off else "–"
        inside = [value for row in some for value in row.get("covered", [])]
        right = [verdict for row in some if (verdict := named_right(row)) is not None]
        words = f"{name}{', declared' if declared else ''}{', still' if still else ''}"
        size = f"{level}: {np.median([row['size'] for row in some]):.3g} {TROUBLES[name].unit}"
        lines.append(
            f"| {words} | {size} | {method} | {worst} | {sum(inside)} of {len(inside)} "
            f"| {over_u(some)} | {sum(map(warned, some))} of {len(some)} | {_counted(some)} "
            f"| {f'{sum(right)} of {len(right)}' if right else '–'} | {sum(map(silently_wrong, some))} "
            f"| {sum(map(beyond_its_price, some))} |"
        )
    return "\n".join(lines)


def summary(rows) -> str:
    """A line for each trouble, and one for all: what it leads to at both sizes, in %, source/gls/joint."""
    troubled = [row for row in rows if row["trouble"] != CLEAN]
    names = [name for name in TROUBLES if any(row["trouble"] == name for row in troubled)]
    head = " | ".join(f"{level}: {' | '.join(columns)}" for level, columns in SUMMARY.items())
    lines = [f"| trouble | size | {head} |", "|---" * 10 + "|"]
    for name in [*names, None]:
        some = [row for row in troubled if name in (None, row["trouble"])]
        by = {level: [row for row in some if row["level"] == level] for level in LEVELS}
        cells = [_cells(by[level])[column] for level, columns in SUMMARY.items() for column in columns]
        size = _sizes(TROUBLES[name].unit, filter(None, by.values())) if name else ""
        lines.append(f"| {' | '.join([name or '**all**', size, *cells])} |")
    return "\n".join(lines)


def silence(rows) -> str:
    """Who is silently wrong, by how many half-widths, and by what part of that with the price that is told."""
    lines = []
    for level in LEVELS:
        some = [row for row in rows if row["level"] == level]
        wrong = [row for row in some if silently_wrong(row)]
        kinds = ", ".join(f"{name} {count}" for name, count in Counter(row["trouble"] for row in wrong).most_common())
        lines.append(f"{level}: {len(wrong)} of {len(some)} silently wrong{': ' * bool(kinds)}{kinds}")
        off, priced = ([np.max(row[name]) for row in wrong if name in row] for name in ("off", "off_with_price"))
        if off:
            lines[-1] += f"; half-widths: {np.median(off):.2g} median, {max(off):.2g} most"
            lines[-1] += f"; with the price told {min(priced):.2f} to {max(priced):.2f}"
    return "\n".join(lines)


def _cells(rows):
    """Covered, warned, named right and silently wrong, each by method; what there is none of is left empty."""
    by = [[row for row in rows if row["method"] == method] for method in METHODS]
    covered = [[value for row in some for value in row.get("covered", [])] for some in by]
    named = [[verdict for row in some if (verdict := named_right(row)) is not None] for some in by]
    silent = [[silently_wrong(row) for row in some] for some in by]
    return {
        "covered": _percents(covered),
        "error/u": _of_methods(map(over_u, by)),
        "warned": _percents([[warned(row) for row in some] for some in by]),
        "named": _percents(named) if any(named) else "",
        "silent": _percents(silent) if np.any([any(some) for some in silent]) else "",
    }


def _percents(groups):
    """The part of each group that is true, such as 98/100/–; a single figure where all are equal."""
    return _of_methods(f"{100 * np.mean(some):.0f}" if some else "–" for some in groups)


def _of_methods(cells):
    figures = list(cells)
    return figures[0] if len(set(figures)) == 1 else "/".join(figures)


def _sizes(unit, levels):
    """The median size at each level, with its unit."""
    unit = unit.removeprefix("1").strip()
    figures = ", ".join(f"{np.median([row['size'] for row in rows]):.2g}" for rows in levels)
    return f"{figures} ({unit})" if "," in unit else f"{figures} {unit}".strip()


def _counted(rows):
    """The first causes that were named, the most frequent first."""
    return ", ".join(f"{cause} {count}" for cause, count in Counter(map(first_cause, rows)).most_common(3))


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--troubles", nargs="*", default=list(TROUBLES), choices=list(TROUBLES), metavar="NAME")
    parser.add_argument("--runs", type=int, default=20, help="of each trouble, size and method")
    parser.add_argument("--clean", type=int, default=0, help="clean runs of each method")
    parser.add_argument("--methods", nargs="+", default=list(METHODS), choices=METHODS)
    parser.add_argument("--levels", nargs="+", default=list(LEVELS), choices=LEVELS)
    parser.add_argument("--still", action="store_true", help="the motion that keeps the centre of gravity still")
    parser.add_argument("--declared", action="store_true", help="troubles declared as sources of their size")
    parser.add_argument("--summary", action="store_true", help="a line for each trouble")
    parser.add_argument("--out", default="out/troubles.jsonl")
    parser.add_argument("--processes", type=int, default=2)
    asked = parser.parse_args(arguments)
    cells = clean_cells(asked.clean, asked.methods, (asked.still,)) + trouble_cells(
        asked.troubles, asked.runs, asked.methods, asked.levels, still=asked.still, declared=asked.declared
    )
    with contextlib.suppress(KeyboardInterrupt):
        run_cells(cells, asked.out, asked.processes)
    rows = rows_in(asked.out)
    print(clean_table(rows), summary(rows) if asked.summary else table(rows), silence(rows), sep="\n\n")


if __name__ == "__main__":
    main()
