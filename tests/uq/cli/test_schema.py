"""``inertia schema``: what it prints is shipped, takes every shipped file, and refuses what the loader refuses."""

import copy
import json
import subprocess
import sys
import tomllib
from functools import cache, partial
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator, FormatChecker

from uq.cli.main import main
from uq.cli.schema import FILES, file_schema, shipped_text
from uq.files.units import quantity, scale

ROOT = Path(__file__).parents[3]
SHIPPED = [*ROOT.glob("uq/presets/*.toml"), *ROOT.glob("uq/examples/*.toml")]
MAP = {
    "columns": {
        "rate": "100 Hz",
        "force": ["a", "b", "c"],
        "moment": ["d", "e", "f"],
        "angular_velocity": ["g", "h", "i"],
    },
    "recording": {"wrench": "on_body", "force_unit": "N", "moment_unit": "N*m", "angular_velocity_unit": "deg/s"},
}


def formats():
    """The checks of ``format`` that stand in the schemas: a validator knows no units by itself."""
    checker = FormatChecker()

    def formats_in(schema):
        if isinstance(schema, dict):
            yield from [schema["format"]] if isinstance(schema.get("format"), str) else []
        for part in schema.values() if isinstance(schema, dict) else schema if isinstance(schema, list) else ():
            yield from formats_in(part)

    for name in {name for file in FILES for name in formats_in(file_schema(file))}:
        kind, _, unit = name.partition(" ")
        read = {"quantity": quantity, "unit": scale}.get(kind)
        if read is not None:
            checker.checks(name, ValueError)(partial(taken, read, unit))
    return checker


def taken(read, unit, value):
    """Whether a quantity or a unit can be read."""
    return readable(read, unit, value) if isinstance(value, str) else read(value, unit) is not None


@cache
def readable(read, unit, text):
    """Remembered, refusals above all: a schema tries each unit that a key may have, and the files are nearly the same."""
    try:
        return read(text, unit) is not None
    except ValueError:
        return False


@pytest.fixture(scope="module")
def mistakes():
    checker = formats()
    validators = {file: Draft202012Validator(file_schema(file), format_checker=checker) for file in FILES}

    def listed(file, content):
        plain = json.loads(json.dumps(content, default=str))  # dates as an editor's server has them: text
        return [error.message for error in validators[file].iter_errors(plain)]

    return listed


@pytest.mark.parametrize("file", FILES)
def test_the_shipped_schema_is_what_the_command_prints(file, capsys):
    assert main(["schema", file]) == 0
    printed = capsys.readouterr().out
    assert printed == (ROOT / "uq" / "schemas" / f"{file}.json").read_text("utf-8")
    assert printed == shipped_text(file), "run `python -m uq.cli.schema`"
    Draft202012Validator.check_schema(json.loads(printed))


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.name)
def test_every_shipped_file_names_the_schema_that_takes_it(path, mistakes):
    text = path.read_text("utf-8")
    named = text.splitlines()[0].removeprefix("#:schema ")
    schema = (path.parent / named).resolve()
    assert schema.parent == ROOT / "uq" / "schemas"
    assert mistakes(schema.stem, tomllib.loads(text)) == []


def test_a_map_is_taken(mistakes):
    assert mistakes("map", MAP) == []
    assert mistakes("map", MAP | {"recording": MAP["recording"] | {"force_unit": "kg"}})


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("body", "mas"), "1 kg"),
        (("body", "mass"), 19.7),
        (("body", "mass"), "19.7 N"),
        (("body", "mass"), "19.7"),
        (("body", "r_cg_from_q"), ["0 m", "0 m"]),
        (("body", "r_cg_from_q", 1), "1 kg"),
        (("platform", "gravity"), "9.81 m/s"),
        (("platform", "geometry"), "mine"),
        (("trajectory", "T1", "kind"), "circle"),
        (("trajectory", "T3", "precessions"), 10),
        (("trajectory", "T1", "precessions"), "10"),
        (("estimator", 0, "differentiator"), "spline"),
        (("recording", "wrench"), "up"),
        (("recording", "force_unit"), "kg"),
        (("recording", "imu_rotation_to_body"), [[1, 0, 0], [0, 1, 0]]),
        (("bodyy",), {}),
        (("source", 0, "sigma"), ["5 N", "5 N"]),
        (("source", 0, "sigma"), ["5 N*m", "5 N*m", "5 N*m"]),
        (("source", 0, "sigm"), ["5 N", "5 N", "5 N"]),
        (("source", 4, "kind"), "precision"),
        (("source", 0, "distribution"), "cauchy"),
    ],
)
def test_what_the_loader_refuses_is_refused(mistakes, preset, path, value):
    document = copy.deepcopy(dict(preset.document))  # which the schema takes: it is a shipped file
    *above, last = path
    table = document
    for key in above:
        table = table[key]
    table[last] = value
    assert mistakes("experiment", document)


def test_keys_are_explained_with_their_units():
    definitions = file_schema("experiment")["$defs"]
    body = definitions["BodyTable"]["properties"]
    assert body["mass"]["description"] == 'Mass of the body. With its unit, such as "1 kg".'
    assert body["mass"]["$ref"] == "#/$defs/quantity_in_kg"
    assert definitions["quantity_in_kg"]["format"] == "quantity kg"
    assert file_schema("rig")["$defs"]["DeviceTable"]["properties"]["wrench"]["enum"] == ["on_body", "on_sensor"]


def test_the_command_needs_neither_jax_nor_the_tables():
    """What is shipped is printed: in a tenth of a second where the tables took more than one."""
    code = "import sys; from uq.cli.main import main; main(['schema', 'rig']); print(set(sys.argv) & set(sys.modules))"
    ran = subprocess.run([sys.executable, "-c", code, "jax", "numpy", "msgspec"], capture_output=True, text=True)
    assert ran.stdout.endswith("}\nset()\n"), ran.stdout[-200:] + ran.stderr
