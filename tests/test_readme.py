"""The README's Python runs as it stands, and its commands exist."""

import re
from pathlib import Path

import numpy as np

from uq.cli.main import COMMANDS

README = Path(__file__).parent.parent / "README.md"


def test_the_example_runs_and_finds_its_tensor():
    codes = re.findall(r"```python\n(.*?)```", README.read_text("utf-8"), flags=re.S)
    assert [len([line for line in code.splitlines() if line.strip()]) for code in codes] == [11, 5]
    names = {}
    for code in codes:
        exec(code, names)
    result = names["result"]
    printed = re.search(r"```text\n(component.*?)```", README.read_text("utf-8"), flags=re.S)[1]
    rows = {line.split()[0]: [float(x) for x in line.split()[1:]] for line in printed.splitlines()[1:]}
    ours = np.column_stack([result.inertia, result.bias, result.standard_uncertainty, result.interval95])
    np.testing.assert_allclose(list(rows.values()), ours, rtol=2e-3, atol=1e-6)
    np.testing.assert_allclose(np.asarray(names["tensors"]).mean(axis=0)[[0, 3, 5]], [0.381, 0.019, 0.379], atol=1e-3)
    assert abs(names["slope"] - 0.381) < 1e-4  # a gain of the moment is one of the tensor
    assert abs(result.inertia[0] - 0.381) < 4 * result.standard_uncertainty[0]
    assert result.standard_uncertainty[0] < 0.01


def test_its_commands_exist():
    text = README.read_text("utf-8")
    used = set(re.findall(r"^inertia (\w+)", text, flags=re.M))
    assert used
    assert used <= set(COMMANDS)
    for target in set(re.findall(r"make (\w+)", text)):
        assert re.search(rf"^{target}:", (README.parent / "Makefile").read_text(), flags=re.M), target


def test_every_relative_link_leads_somewhere():
    """Links to generated pages are those of the site's own test."""
    for page in [README, *README.parent.glob("docs/**/*.md")]:
        for target in re.findall(r"\]\(([^)#:]+)\)", page.read_text("utf-8")):
            assert "generated/" in target or (page.parent / target).exists(), (page.name, target)
