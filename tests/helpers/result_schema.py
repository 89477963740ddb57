"""The shipped schema of result files, as a validator."""

import json
from functools import cache
from pathlib import Path

from jsonschema import Draft202012Validator
from jsonschema.exceptions import best_match

ROOT = Path(__file__).parents[2]


@cache
def validators() -> dict[str, Draft202012Validator]:
    """A validator for each kind of file: a choice of them would not say which key is wrong."""
    schema = json.loads((ROOT / "uq" / "schemas" / "result.json").read_text("utf-8"))
    definitions = schema["$defs"]
    names = [choice["$ref"].rsplit("/", 1)[1] for choice in schema["oneOf"]]
    return {
        kind: Draft202012Validator({"$ref": f"#/$defs/{name}", "$defs": definitions})
        for name in names
        for kind in definitions[name]["properties"]["kind"]["enum"]
    }


def contradictions(text: str) -> list[str]:
    """What in a result's file contradicts the schema of its kind."""
    content = json.loads(text)
    errors = (best_match([error]) for error in validators()[content["kind"]].iter_errors(content))
    return [f"{'/'.join(map(str, error.absolute_path))}: {error.message[:200]}" for error in errors]
