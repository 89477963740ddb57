"""The examples of docs/how-to/extending.md: each new file is put into its folder, found, and used as the page shows."""

import importlib
import re
import sys
from pathlib import Path

import numpy as np
import pytest

from rig.record.port import converse
from uq.sources.source import KINDS

PAGE = Path(__file__).parents[1] / "docs" / "how-to" / "extending.md"
FILE = re.compile(r"File `(\w+\.py)` in `([\w/]+)/`:\n\n```{literalinclude} (\S+)\n:language: python\n```")
USE = re.compile(r"```(python|toml)\n(.*?)```", re.S)


def section(title):
    """The files of a section by folder, its experiment files by the name of their source, and its scripts in order."""
    text = PAGE.read_text("utf-8").split(f"## {title}\n")[1].split("\n## ")[0]
    blocks = USE.findall(FILE.sub("", text))
    sources = {re.search(r'name = "(\w+)"', block)[1].upper(): block for kind, block in blocks if kind == "toml"}
    files = [(name, folder, (PAGE.parent / path).read_text("utf-8")) for name, folder, path in FILE.findall(text)]
    return files, sources, [block for kind, block in blocks if kind == "python"]


@pytest.fixture
def folders(tmp_path, monkeypatch):
    """What puts files into folders of the packages, for the length of a test."""
    kinds, added = dict(KINDS), []

    def put(files):
        for number, (name, folder, content) in enumerate(files):
            place = tmp_path / str(number)
            place.mkdir()
            (place / name).write_text(content, "utf-8")
            package = importlib.import_module(folder.replace("/", "."))
            monkeypatch.setattr(package, "__path__", [*package.__path__, str(place)])
            added.append(f"{package.__name__}.{name.removesuffix('.py')}")
            importlib.import_module(added[-1])

    yield put
    for module in added:
        sys.modules.pop(module, None)
    KINDS.clear()
    KINDS.update(kinds)


def run(scripts, names):
    names = {"__name__": "extending", **names}
    for script in scripts:
        exec(compile(script, str(PAGE), "exec"), names)
    return names


def test_a_new_kind_of_error_source(folders, monkeypatch):
    monkeypatch.chdir(PAGE.parents[1])
    files, sources, scripts = section("A new kind of error source")
    folders(files)
    names = run(scripts, sources)
    assert [name for name, *_ in files] == ["thermal_zero.py"]
    # 200 trials tell a 3σ within 5 %: 1e-4 false alarms in six components at 4.2 of these
    np.testing.assert_allclose(names["monte_carlo"], names["by_law"], rtol=0.21)
    assert (names["by_law"] > 0).all()


class Wire:
    """A port whose other end is the emulator."""

    def __init__(self, sensor):
        self.sensor, self.answer = sensor, b""

    def write(self, data):
        self.answer += self.sensor.receive(data)

    def read(self):
        answer, self.answer = self.answer, b""
        return answer


def test_a_new_device(folders):
    files, _, scripts = section("A new device")
    folders(files)
    names = run(scripts, {})
    assert converse(names["device"].start(), Wire(names["sensor"])).model == "ACME 6"
    assert names["sensor"].streaming
    assert [s.number for s in names["samples"]] == [0, 1, 3, 4]
    assert all(s.values == (1.0, 2.0, 3.0, 0.5, 0.25, 0.125) for s in names["samples"])
    assert (names["parser"].counts.missing, names["parser"].counts.skipped) == (1, len(b"noise"))


def test_a_new_export_format(folders, tmp_path):
    files, _, scripts = section("A new export format")
    folders(files)
    exported = run(scripts, {})["exported"]
    exported.write(tmp_path)
    text = (tmp_path / "body.m").read_text("utf-8")
    assert text.startswith("% Written by inertia-uq.")
    rows = re.search(r"inertia = \[(.*)\];", text)[1].split(";")
    np.testing.assert_array_equal([np.fromstring(row, sep=" ") for row in rows], np.diag([0.3813, 0.0185, 0.3791]))
    assert set(exported.to_dict()) == {"matlab", "urdf"}


def test_a_new_estimator(folders, monkeypatch):
    monkeypatch.chdir(PAGE.parents[1])
    files, _, scripts = section("A new estimator")
    folders(files)
    from uq import Experiment

    names = run(scripts, {"Experiment": Experiment})
    off = {how: np.abs(names[f"by_{how}"].inertia - names["quiet"].inertia) for how in ("mean", "median")}
    moments = [0, 3, 5]
    assert (off["median"][moments] < 0.3 * off["mean"][moments]).all()
    assert (off["median"] < 4 * np.sqrt(np.diag(names["by_median"].covariance))).all()
    assert names["by_median"].method == "median_of_runs"
