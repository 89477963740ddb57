"""Values that no one writes by mistake: each is one line of less than 200 characters, status 2, and at once."""

import importlib
import os
import signal
import subprocess
import sys
import time
from importlib import resources
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from identify.signals.differentiate import matched
from identify.signals.filters import gaussian
from tests.helpers.rig_lab import ramp_run
from uq.bodies.export_formats import mjcf, sdf, urdf
from uq.bodies.exported_body import ExportedBody
from uq.cli.main import main

PRESET = resources.files("uq").joinpath("presets", "barreto2016.toml").read_text("utf-8")
MASS = 'mass = "19.7 kg"'
HUGE = "9" * 401


def in_quotes(key, *values):
    return [f'{key} = "{value}"' for value in values]


VALUES = {
    MASS: [
        *in_quotes("mass", "nan kg", "1e400 kg", f"{HUGE} kg", "1 " + "kg*" * 2000 + "kg", "1 " + "k" * 100_000, "1_0 kg"),
        *in_quotes("mass", "1e308 kg", r"1 kg\nfoo", "1 kg^999999999", "1 kg^9^9^9", "1 " + "(" * 5000 + "kg", "١ kg"),
        *[f"mass = {value}" for value in (HUGE, "nan", "-inf", "[[[[]]]]", "{}", "1979-05-27T07:32:00Z")],
    ],
    'band = "1.55 Hz"': in_quotes("band", "1e15 Hz", "0 Hz", "nan Hz", "1e-15 Hz", "1e-15 Hz\"\nlowpass = \"1e15 Hz"),
    'name = "F_bias"': [*in_quotes("name", "x" * 100_000, "", r"a\nb", r"\u0000", r"\u001b[31m"), "name = 3"],
    'kind = "precision"': in_quotes("kind", "z" * 3000, "", r"bias\n"),
    "[trajectory.T1]": [r'[trajectory."a\n"]', f'[trajectory."{"x" * 500}"]', '[trajectory.""]'],
    'name = "F_precision"\ntarget = "F"': [
        'name = "F_precision_on_the_platform"\ntarget = { I11 = "381.3 g*m^2", I22 = "18.5 g*m^2", I33 = "379.1 g*m^2" }',
    ],
    "[body]": ["[body]\n" + "k" * 5000 + " = 1", '[body]\n"a\\u001b[31m\\nb" = 1', "[body]\nmas = 1"],
}  # fmt: skip


def complaint(capsys, *argv):
    """The line that a command ends with."""
    start = time.process_time()
    try:
        status = main(list(argv))
    except SystemExit as end:
        status = end.code
    printed = capsys.readouterr()
    lines = printed.err.splitlines()
    assert status == 2
    assert (len(lines), printed.out) == (1, "")
    assert lines[0].startswith("error: ")
    assert lines[0].isprintable()
    assert len(lines[0]) < 200
    assert time.process_time() - start < 5
    return lines[0]


@pytest.mark.parametrize(
    ("text", "instead"),
    [(text, instead) for text, values in VALUES.items() for instead in values],
    ids=lambda v: v[:30],
)
def test_a_value_of_an_experiment(text, instead, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert text in PRESET
    (tmp_path / "e.toml").write_text(PRESET.replace(text, instead, 1))
    complaint(capsys, "montecarlo", "e.toml", "--trials", "2")


@pytest.mark.parametrize(
    "options",
    [("--estimator", ""), ("--estimator", "x" * 5000), ("--trajectory", ""), ("--trajectory", "a\nb"), ("--trials", HUGE),
     ("--dtype", "y" * 5000), ("--tolerance", HUGE), ("--no\nsuch",)],
    ids=lambda options: options[-1][:20],
)  # fmt: skip
def test_an_option(options, capsys):
    complaint(capsys, "montecarlo", "barreto2016", *options)


MAP = """
[columns]
time = "t"
time_unit = "s"
force = ["a", "b", "c"]
moment = ["d", "e", "f"]
angular_velocity = ["g", "h", "i"]
[recording]
wrench = "on_body"
force_unit = "N"
moment_unit = "N*m"
angular_velocity_unit = "rad/s"
"""
FROM_A_FIFO = [
    "montecarlo fifo", "record fifo -o r.mcap", "import fifo --map map.toml -o r.mcap", "import t.csv --map fifo -o r.mcap",
    "identify r.mcap --experiment barreto2016 --expected fifo", "identify r.mcap --experiment barreto2016 --centre fifo",
    "inspect r.mcap --experiment fifo",
]  # fmt: skip


@pytest.mark.parametrize("command", FROM_A_FIFO)
def test_a_fifo_as_any_file_is_refused_and_not_waited_for(command, tmp_path, capsys, monkeypatch):
    def too_long(*_):
        raise AssertionError("it waits for the FIFO")

    importlib.import_module("uq.cli." + command.split()[0].replace("import", "import_"))  # outside the time limit
    monkeypatch.chdir(tmp_path)
    os.mkfifo("fifo")
    Path("map.toml").write_text(MAP)
    if "r.mcap --" in command:
        ramp_run(tmp_path / "r.mcap", 0.2)
    before = signal.signal(signal.SIGALRM, too_long)
    signal.alarm(5)
    try:
        assert "not a file fifo but a FIFO: give a file" in complaint(capsys, *command.split())
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def test_an_unknown_command(capsys):
    complaint(capsys, "x" * 10_000)


def test_the_nearest_key_is_named_first(tmp_path, capsys):
    (tmp_path / "e.toml").write_text(PRESET.replace(MASS, 'mas = "19.7 kg"'))
    assert "unknown key body.mas: did you mean mass?" in complaint(capsys, "montecarlo", str(tmp_path / "e.toml"))


def test_a_differentiator_for_too_low_a_band_is_refused_at_once():
    with pytest.raises(ValueError, match="`band` must be within a factor of 50,000 of the rate"):
        matched(400.0, 1e-15)


def test_a_low_pass_longer_than_any_run_is_refused_before_it_fills_the_memory():
    with pytest.raises(ValueError, match="give a higher cut-off"):
        gaussian(400.0, 1e-15)


@pytest.mark.parametrize("form", [urdf.urdf, mjcf.mjcf, sdf.sdf])
def test_xml_is_well_formed_whatever_the_run_is_called(form):
    notes = ("--->", "a--b---c-", "\x00\x1b<&]]>", "line\nline")
    body = ExportedBody(1.0, np.zeros(3), np.array([1.0, 0, 0, 1, 0, 1]), notes, name='"--->\x07')
    text = form(body)
    ElementTree.fromstring(text)
    assert r"\u001b" in text


@pytest.mark.parametrize("module", ["numpy", "jax", "uq.cli.terminal.processes"])
def test_ctrl_c_while_python_imports_is_one_line(module):
    """When this module is there: of the first imports, of the middle, the last before the campaign."""
    command = [sys.executable, "-X", "importtime", "-m", "uq.cli.main", "paper"]
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # were it ignored here, it would be there
    try:
        process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    finally:
        signal.signal(signal.SIGINT, before)
    with process:
        while process.stderr.readline().split("|")[-1].strip() != module:
            assert process.poll() is None
        process.send_signal(signal.SIGINT)
        said = [line for line in process.stderr if not line.startswith("import time:")]
    assert (process.returncode, said) == (130, ["error: interrupted\n"])


def test_a_reader_that_has_enough_ends_the_command_in_silence():
    command = [sys.executable, "-m", "uq.cli.main", "schema", "experiment"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        process.stdout.close()
        assert (process.stderr.read(), process.wait()) == (b"", 141)
