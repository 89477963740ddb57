"""Result files of version 1 stay readable: they are kept, and are never made again."""

import json
from pathlib import Path

import numpy as np
import pytest

from identify.estimation.static_poses.centre_result import Centre
from tests.helpers.result_schema import contradictions, validators

OLD = sorted((Path(__file__).parents[2] / "result_files").glob("*.json"))


@pytest.mark.parametrize("path", OLD, ids=lambda path: path.stem)
def test_an_old_file_follows_the_schema(path):
    assert contradictions(path.read_text("utf-8")) == []


@pytest.mark.parametrize("path", OLD, ids=lambda path: path.stem)
def test_a_file_of_another_version_or_without_a_key_does_not(path):
    content = json.loads(path.read_text("utf-8"))
    assert contradictions(json.dumps(content | {"version": 2}))
    assert contradictions(json.dumps({key: value for key, value in content.items() if key != "warnings"}))


def test_every_kind_of_the_schema_says_what_each_of_its_keys_is():
    for validator in validators().values():
        schema = validator.schema
        table = schema["$defs"][schema["$ref"].rsplit("/", 1)[1]]
        for key, value in table["properties"].items():
            assert "description" in value or "$ref" in value or "const" in value, key


def test_an_old_centre_is_read_with_its_figures():
    path = next(path for path in OLD if path.stem == "centre-1")
    content = json.loads(path.read_text("utf-8"))
    centre = Centre.from_dict(content)
    assert centre.mass == content["mass"]["value"]
    np.testing.assert_array_equal(centre.r_cg, content["cg"]["value"])
    np.testing.assert_array_equal(centre.covariance, content["covariance"])
