"""Every finding is a file with its page, and every limit of the judge says where it comes from."""

import ast
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from identify.judge.cure import Cure, Entries, Opposite, written
from identify.judge.finding_pages import all_findings
from identify.judge.run_findings.saturation import saturated
from tests.helpers.laboratory import measure
from tests.helpers.laboratory_runs import run_of
from tests.helpers.troubles import TROUBLES

ROOT = Path(__file__).parents[3]
ORIGIN = re.compile(r"^(Chance|Choice|Definition|Measured|Numerical|Price|Prior): \S", re.MULTILINE)
"""Where a number comes from: a probability, our choice, a standard, a study, rounding, its cost, a wide prior."""
SECTIONS = ["What it looks like", "Why it matters", "How it is decided", "What to do"]
PAGES = {page.label: page for page in all_findings()}


@pytest.mark.parametrize("label", PAGES)
def test_a_finding_leads_to_its_row_in_the_docs_and_that_to_its_page(label):
    page, anchor = PAGES[label].examples[0].docs.split("#")
    row = f'<a id="{anchor}"></a>[`{label}`](findings/{anchor}.md)'
    assert (ROOT / page).read_text("utf-8").count(row) == 1
    assert (ROOT / page).with_name("findings").joinpath(f"{anchor}.md").exists()


@pytest.mark.parametrize("label", PAGES)
def test_the_docstring_of_a_finding_is_its_page(label):
    text = PAGES[label].text
    assert re.findall(r"^## (.*)$", text, re.M) == SECTIONS
    assert re.fullmatch(r"[A-Z][^\n]*\.", text.split("\n\n")[0])


@pytest.mark.parametrize("label", PAGES)
def test_each_variant_of_a_finding_has_an_example_that_writes_its_text(label):
    page = PAGES[label]
    module = type(page.examples[0]).__module__
    assert {type(example).__name__ for example in page.examples} == variants(ROOT / f"{module.replace('.', '/')}.py")
    assert {example.label for example in page.examples} == {label}
    for example in page.examples:
        assert not re.search(r"[{}]|\bNone\b|  ", example.text.replace("{ ", "").replace(" }", ""))


def variants(path: Path) -> set[str]:
    """Classes of a file that are findings."""
    classes = [node for node in ast.parse(path.read_text("utf-8")).body if isinstance(node, ast.ClassDef)]
    return {node.name for node in classes if any(ast.unparse(base) == "Finding" for base in node.bases)}


def test_a_cure_is_data_that_one_function_writes():
    reverse = Entries({"wrench": Opposite("on_sensor", "on_body")})
    turn = Entries({"imu_rotation_to_body": np.eye(3)[[1, 2, 0]]}, remark=" if the IMU is the rotated one")
    other = Entries({"wrench_rotation_to_body": 0.5 * np.eye(3)}, conjunction="otherwise")
    assert written(Cure(choices=[Entries({"wrench_frame": "base"})])) == 'set wrench_frame = "base" in [recording]'
    assert written(Cure(choices=[turn, other], with_it=[reverse], then=", or correct the clock")) == (
        'set wrench = "on_sensor" ("on_body" if that is already set) and imu_rotation_to_body = "y, z, x" if the IMU is '
        "the rotated one, otherwise wrench_rotation_to_body = [[0.50000, 0.00000, 0.00000], [0.00000, 0.50000, 0.00000], "
        "[0.00000, 0.00000, 0.50000]], in [recording], or correct the clock"
    )
    takes, gravity = Entries({"takes": "other"}, table="poses"), Entries({"urdf_gravity": ["0.000 m/s^2", "1", "2"]})
    assert written(Cure(choices=[gravity], with_it=[takes])) == (
        'set takes = "other" in [poses] and urdf_gravity = ["0.000 m/s^2", "1", "2"] in [recording]'
    )


def test_a_cure_names_the_map_for_the_keys_that_it_has():
    """The map of an imported run states units and axes; what else is set stays in the experiment."""
    wrench, down = Entries({"wrench": "on_sensor"}), Entries({"accelerometer_at_rest": "down"})
    both = Entries({**wrench.values, **down.values})
    map_keys, in_map = ("wrench",), "in [recording] of the map, on top of what it says, and import the table again"
    assert written(Cure(choices=[wrench]), map_keys) == f'set wrench = "on_sensor" {in_map}'
    assert written(Cure(choices=[down]), map_keys) == 'set accelerometer_at_rest = "down" in [recording]'
    assert written(Cure(choices=[wrench, down]), map_keys) == (
        f'set wrench = "on_sensor" {in_map}, or accelerometer_at_rest = "down" in [recording]'
    )
    assert written(Cure(choices=[both]), map_keys) == (
        f'set wrench = "on_sensor" {in_map} and accelerometer_at_rest = "down" in [recording]'
    )


def test_what_a_cure_sets_can_be_read_again():
    entries = Entries({"urdf_gravity": ["0.000 m/s^2"], "calibration": [[-1.0, 2.5e-7]], "quaternion": {"w": "q0"}})
    lines = [entry.line for entry in entries.separate]
    assert tomllib.loads("\n".join(lines)) == entries.values


def test_a_verdict_says_where_it_is_explained():
    run = run_of(measure(0, seconds=5.0, **TROUBLES["clipping"].options(0.1, 0)))
    verdict = saturated(run)[0]
    assert verdict._asdict()["docs"] == "docs/explanation/troubles.md#saturation"


def numbers(tree: ast.Module) -> Iterator[tuple[str, str]]:
    """Constants of numbers, in angles or not, each with its docstring."""
    for statement, following in zip(tree.body, [*tree.body[1:], None], strict=True):
        if isinstance(statement, ast.Assign) and re.match(r"\w+ = .*\d", ast.unparse(statement)):
            value = re.sub(r"^np\.radians", "", ast.unparse(statement.value))
            try:
                ast.literal_eval(value)
            except ValueError:
                continue
            text = ast.unparse(following) if isinstance(following, ast.Expr) else "''"
            yield ast.unparse(statement.targets[0]), ast.literal_eval(text)


def test_every_limit_of_the_judge_says_where_it_comes_from():
    without = [
        f"{path.relative_to(ROOT)}: {name}"
        for path in sorted((ROOT / "identify" / "judge").rglob("*.py"))
        for name, text in numbers(ast.parse(path.read_text("utf-8")))
        if not ORIGIN.search(text)
    ]
    assert without == []
