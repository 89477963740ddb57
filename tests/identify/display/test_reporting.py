"""What all results share: one set of tables makes terminal, notebook, JSON and DataFrame; figures are drawn when asked for."""

import subprocess
import sys

import numpy as np
import pytest
from IPython.core.formatters import PNGFormatter
from matplotlib.figure import Figure

from identify.display.reporting import Figures, plain, stem
from tests.helpers.weighing import Weighed, weighing


@pytest.fixture
def weighed():
    return weighing()


def test_terminal_and_notebook_show_the_same_but_for_long_tables(weighed):
    assert repr(weighed) == "One <weighing>\n      kg\n────  ──\nmass   2\nattention: it moved"
    html = weighed._repr_html_()
    assert html.count("<table>") == 2
    assert "<caption>One &lt;weighing&gt;</caption>" in html
    assert html.endswith("<ul><li>attention: it moved</li></ul>")


def test_json_has_every_field_and_no_nan(weighed):
    assert weighed.to_dict() == {"mass": 2.0, "spread": [1.0, None], "warnings": ["it moved"]}
    nested = {"a": (np.float64(np.inf), np.int64(3)), 4: Weighed(1.0, np.zeros((1, 2)))}
    assert plain(nested) == {"a": [None, 3], "4": {"mass": 1.0, "spread": [[0.0, 0.0]], "warnings": []}}


def test_figures_are_drawn_once_and_only_when_asked_for(weighed):
    figures = weighed.figures()
    assert list(figures) == ["mass"]
    assert "How heavy." in repr(figures)
    assert weighed.drawn == []
    assert figures["mass"] is figures["mass"]
    assert weighed.drawn == ["mass"]
    assert PNGFormatter()(figures["mass"]).startswith(b"\x89PNG")  # in a notebook without %matplotlib inline
    assert len(Figures([])) == 0


def test_a_place_or_name_that_cannot_be_is_named(weighed):
    with pytest.raises(ValueError, match=r"^Argument `ax` must be an axes of a grid, as plt\.subplots makes them"):
        weighed.figures().draw("mass", ax=Figure().add_axes((0, 0, 1, 1)))
    with pytest.raises(KeyError, match=r"^no 'weight': choose one of 'mass'$"):
        weighed.figures().draw("weight", ax=Figure())


def test_every_result_has_a_section_even_if_it_says_nothing_more(weighed):
    section = weighed.section()
    assert (section.title, section.findings, section.front) == ("One <weighing>", ("it moved",), None)
    assert [table.caption for table in section.tables] == ["", "long"]


def test_names_of_figures_stay_in_the_folder():
    assert stem("a", "../b", "ω") == "a-..%2Fb-%CF%89"


IDENTIFY_ALONE = """
import importlib, pkgutil, sys, identify
for module in pkgutil.walk_packages(identify.__path__, "identify."):
    importlib.import_module(module.name)
import numpy as np
print(identify.InertialParameters(2.0, np.zeros(3), np.arange(6.0), np.eye(10)))
print(*{"matplotlib", "uq"} & set(sys.modules))
"""


def test_identify_alone_prints_bare_numbers_and_imports_no_matplotlib():
    ran = subprocess.run([sys.executable, "-c", IDENTIFY_ALONE], check=True, capture_output=True, text=True)
    head, _, mass, *_, last = ran.stdout.split("\n")[:-1]
    assert head.split() == ["parameter", "value", "standard_uncertainty"]
    assert mass.split() == ["mass", "2", "1"]
    assert last == ""


def test_no_matplotlib_and_no_pandas_until_a_figure_or_frame_is_asked_for():
    script = (
        "import sys, uq, identify\n"
        "for package in (uq, identify):\n"
        "    [getattr(package, name) for name in package.__all__]\n"
        "print(*{'matplotlib', 'pandas'} & set(sys.modules))\n"
    )
    loaded = subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, text=True).stdout
    assert loaded.strip() == ""


def test_a_long_name_becomes_a_short_one_of_its_own():
    names = [stem("breakdown", "漢" * count, "central") for count in (30, 31)]
    assert all(len(name) < 120 for name in names)
    assert len(set(names)) == 2
