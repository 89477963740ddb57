"""Every finding has its place in the documentation, and every limit of the judge says where it comes from."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from identify.judge.findings import Finding
from identify.judge.resonance import saturated
from tests.helpers.laboratory import measure
from tests.helpers.laboratory_runs import run_of
from tests.helpers.troubles import TROUBLES

ROOT = Path(__file__).parents[3]
ORIGIN = re.compile(r"^(Chance|Choice|Definition|Measured|Numerical|Price|Prior): \S", re.MULTILINE)
"""Where a number comes from: a probability, our choice, a standard, a study, rounding, its cost, a wide prior."""


@pytest.mark.parametrize("finding", Finding, ids=lambda finding: finding.name)
def test_a_finding_leads_to_its_row_in_the_docs(finding):
    page, anchor = finding.docs.split("#")
    assert (ROOT / page).read_text("utf-8").count(f'<a id="{anchor}"></a>`{finding.label}`') == 1


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
