"""``python -m benchmarks.studies.walks``: how many files a value passes on its way to a result.

A file is on a walk if one of its functions returns another value when the value at the walk's start is another, all
else being equal, or if JAX traces one of its functions for a program that the value passes through. A walk is done
three times: once for caches, once with empty caches of JAX, and once with the other value. What a recording's thread
returns differs by its clock each time; there a file counts if a function returns a force that no other quantity has. A
file judges if one of its functions runs while a run is identified, and it is in a room that judges.
"""

import hashlib
import struct
import sys
import tempfile
import threading
from collections import Counter, defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import FrameType, FunctionType, ModuleType
from typing import Any

import jax
import numpy as np

jax.config.update("jax_enable_x64", True)

from rig import Recorder, load_rig, read, write  # noqa: E402
from uq import Experiment, identify_files, montecarlo, simulate  # noqa: E402
from uq.monte_carlo.barreto2016 import average_three_sigma  # noqa: E402

ROOT = Path(__file__).parents[2]
PACKAGES = ("uq/", "identify/", "rig/")
TENSOR = ("identify/estimation/methods/source.py", "SourceEstimator.fit")
"""The function whose return ends the walk to the tensor; what follows judges and adds declared errors."""
END = "the walk's end"
JUDGES = ("identify/judge/", "uq/runs/inspection/")
MARK = 37.25
"""A force [N] without rounding in single precision, by which a recording's functions are known."""
Function = tuple[str, str]
"""File and name of a function."""
Hosts = dict[str, set[Function]]
"""By file with functions that JAX traced, the functions that ran the program."""


Walk = tuple[dict[Function, Counter[str]], Hosts, set[str]]
"""Digests of what each function returned, who ran traced ones, and the files of which a function ran at all."""


def walked(action: Callable[[], Any], look: Callable[[Any], str | None]) -> Walk:
    """Return a walk: what functions returned while an action ran, as ``look`` tells it, up to the tensor."""
    returned: dict[Function, Counter[str]] = defaultdict(Counter)
    hosts: Hosts = defaultdict(set)
    ran: Counter[str] = Counter()
    traced = threading.local()

    def on_event(frame: FrameType, event: str, value: Any) -> None:
        name = frame.f_code.co_filename.removeprefix(f"{ROOT}/")
        if event != "return" or not name.startswith(PACKAGES) or frame.f_code.co_name == "<module>":
            return
        ran[name] += 1
        if ran[END]:
            return
        waiting: set[str] = traced.__dict__.setdefault("files", set())
        function = name, frame.f_code.co_qualname
        ran[END] += function == TENSOR
        if any(isinstance(leaf, jax.core.Tracer) for leaf in leaves(value)):
            waiting.add(name)
            return
        for file in waiting:
            hosts[file].add(function)
        waiting.clear()
        if seen := look(value):
            returned[function][seen] += 1

    threading.setprofile(on_event)
    sys.setprofile(on_event)
    try:
        action()
    finally:
        sys.setprofile(None)
        threading.setprofile(None)
    return returned, hosts, {*ran}


def leaves(value: Any, depth: int = 4) -> list[Any]:
    """Return the numbers, arrays and texts that a value is made of."""
    if value is None or isinstance(
        value, (int, float, str, bytes, bytearray, np.ndarray, np.generic, jax.Array, jax.core.Tracer)
    ):
        return [value]
    if isinstance(value, (ModuleType, FunctionType, type)):
        return []
    if isinstance(value, Mapping):
        value = list(value.values())
    if not isinstance(value, (list, tuple)):
        names = getattr(value, "__struct_fields__", None) or vars(value) if hasattr(value, "__dict__") else ()
        value = [getattr(value, name, None) for name in names] if depth else []
    return [leaf for part in value for leaf in leaves(part, depth - 1)] if depth else []


def digest(value: Any) -> str:
    """Return a short digest of a value; keys of random numbers, which no walk changes, by their shape alone."""
    arrays = (np.ndarray, jax.Array)
    parts = [
        np.asarray(x).tobytes()
        if isinstance(x, arrays) and not jax.dtypes.issubdtype(x.dtype, jax.dtypes.extended)
        else repr(getattr(x, "shape", x)).encode()
        for x in leaves(value)
    ]
    return hashlib.sha256(b"|".join(parts)).hexdigest()[:16]


def marked(value: Any) -> str | None:
    """Return a text for a value that holds the mark, as a number or in bytes."""
    patterns = [struct.pack(form, sign * MARK) for form in ("<f", ">f", "<d", ">d") for sign in (1, -1)]
    for leaf in leaves(value):
        if isinstance(leaf, (bytes, bytearray)):
            if any(pattern in leaf for pattern in patterns):
                return "bytes"
        elif isinstance(leaf, (float, np.floating, np.ndarray)) and np.any(np.abs(np.asarray(leaf)) == MARK):
            return "number"
    return None


def differing(actions: Sequence[Callable[[], Any]]) -> tuple[list[str], set[str]]:
    """Return the files on the walk of two actions that differ in a value, and all whose functions returned."""
    actions[0]()  # for caches of ours
    jax.clear_caches()  # so that programs are traced in the first walk
    (first, hosts, ran), (second, _, _) = (walked(action, digest) for action in actions)
    changed = {function for function in {*first, *second} if first.get(function) != second.get(function)}
    files = {file for file, _ in changed} | {file for file, functions in hosts.items() if functions & changed}
    return sorted(files), ran


def sigma_to_table(folder: Path) -> list[str]:
    """Return the files between a sigma and a cell of Table 2: one trajectory of 10 s, three trials on sums."""
    text = (ROOT / "uq/examples/t1-10s.toml").read_text("utf-8")
    path = folder / "experiment.toml"
    path.write_text(text.replace("../..", str(ROOT)), "utf-8")
    document = dict(Experiment.load(path).document)

    def cell(factor: float) -> None:
        sources = [dict(source) for source in document["source"]]
        (moment,) = (source for source in sources if source["name"] == "M_precision")
        moment["sigma"] = [f"{factor * float(text.split()[0])} N*m" for text in moment["sigma"]]
        experiment = Experiment.from_dict(document | {"source": sources})
        campaign = montecarlo(experiment, trials=3, estimators="central")
        average_three_sigma(campaign["T1", "central"].total, (0, 3, 5))

    return differing([partial(cell, factor) for factor in (1.0, 1.5)])[0]


def byte_to_tensor(folder: Path) -> tuple[list[str], list[str]]:
    """Return the files between a byte of a serial port and the tensor, and those that judge the samples meanwhile."""
    experiment = Experiment.load(ROOT / "uq/examples/t1-10s.toml")
    run = simulate(experiment, "T1").run
    simulate(experiment, "T1").write(folder / "true.mcap")
    played = read(folder / "true.mcap")
    played.wrench.force[:, 0] = MARK
    write(folder / "simulated.mcap", wrench=played.wrench, imu=played.imu)
    (folder / "rig.toml").write_text((ROOT / "uq/examples/rig-emulated.toml").read_text("utf-8"), "utf-8")

    def recorded() -> None:
        Recorder(load_rig(folder / "rig.toml"), folder / "run.mcap").run(seconds=2)

    recording, *_ = walked(recorded, marked)
    files = []
    for factor in (1.0, 1.01):
        force = np.concatenate([run.force[:2000], factor * run.force[2000:]])
        path = folder / f"{factor}" / "run.mcap"
        path.parent.mkdir()
        write(path, wrench=replace(played.wrench, force=force), imu=played.imu)
        files.append(path)
    identified, ran = differing([partial(identify_files, [path], experiment) for path in files])
    return sorted({file for file, _ in recording} | {*identified}), sorted(f for f in ran if f.startswith(JUDGES))


def main() -> None:
    """Print each walk's files."""
    with tempfile.TemporaryDirectory() as name:
        table = sigma_to_table(Path(name))
        tensor, judging = byte_to_tensor(Path(name))
    for what, files in {
        "a sigma to a cell of Table 2": table,
        "a serial byte to the tensor": tensor,
        "judging": judging,
    }.items():
        print(f"{what}: {len(files)} files", *files, sep="\n  ")


if __name__ == "__main__":
    main()
