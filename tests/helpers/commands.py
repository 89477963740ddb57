"""Commands called in this process: one that must fail; an experiment file of short trajectories."""

from importlib import resources

from uq.cli.main import main

PRESET = resources.files("uq").joinpath("presets", "barreto2016.toml").read_text("utf-8")
SHORT = PRESET.replace("180 s", "19.75 s").replace("27 s", "2.9 s")
"""Text of an experiment file."""


def refused(capsys, *arguments):
    """Run a command that must fail; return its one line."""
    try:
        status = main([str(a) for a in arguments])
    except SystemExit as stop:  # argparse ends the program itself
        status = stop.code
    assert status == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("error: ")
    assert said.err.count("\n") == 1
    assert "Traceback" not in said.err
    return said.err
