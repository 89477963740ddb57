"""``[[source]]`` and ``[[correlation]]``: every kind is read in its unit; every mistake is one line that names its key."""

import copy
import json
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from identify.identification import identify
from tests.helpers.source_lab import BY_SAMPLES, experiment, source
from uq.experiment.experiment import Experiment
from uq.files.mistakes import ExperimentError
from uq.monte_carlo.campaign.campaign import montecarlo
from uq.monte_carlo.campaign.simulation import simulate
from uq.report.report_files import write as write_report
from uq.sources.recorded_kinds import ErrorByAct
from uq.sources.source import KINDS

EXAMPLES = Path(__file__).parents[3] / "uq" / "examples"
BIAS = source("s", "F", "bias", sigma=["1 N"] * 3)
SCALE = source("t", "M", "scale", sigma=["1 %"] * 3)
FULL = ["300 N", "300 N", "500 N", "20 N*m", "20 N*m", "20 N*m"]


def read(*sources, **options):
    return experiment(*sources, **options).sources[0]


def test_units_of_every_kind():
    assert read(source("s", "F", "drift", sigma=["60 N/min"] * 3)).sigma.tolist() == pytest.approx([1] * 3)
    assert read(source("s", "omega", "scale", sigma=["0.2 %", "200 ppm", "2e-3 dimensionless"])).sigma.tolist() == (
        pytest.approx([2e-3, 2e-4, 2e-3])
    )
    assert read(source("s", "wrench", "misalignment", sigma=["180 deg"] * 3)).sigma.tolist() == pytest.approx(
        [np.pi] * 3
    )
    delay = read(source("s", "omega", "delay", sigma="2 ms", mean="-1 ms"))
    assert (float(delay.sigma), float(delay.mean)) == (2e-3, -1e-3)
    assert float(read(source("s", "gravity", "bias", sigma="1 mm/s^2")).sigma) == 1e-3
    assert read(source("s", "tilt", "bias", sigma=["1 mrad"] * 3)).sigma.tolist() == pytest.approx([1e-3] * 3)
    air = read(source("s", "entrained_air", "bias", sigma="1 g", radii_of_gyration=["1 mm"] * 3))
    assert (float(air.sigma), air.settings["radii_of_gyration"].tolist()) == (1e-3, [1e-3] * 3)
    gyro = read(
        source("s", "omega", "coloured", white=["0.3 deg/hour**0.5"] * 3, random_walk=["1 deg/hour/s**0.5"] * 3)
    )
    np.testing.assert_allclose(gyro.settings["white"], np.deg2rad(0.3) / 60)
    np.testing.assert_allclose(gyro.settings["random_walk"], np.deg2rad(1) / 3600)
    assert "flicker" not in gyro.settings


def test_one_figure_stands_for_all_axes():
    """As in Python, where ``with_source`` takes it: of widths, means, settings, full scales."""
    each = read(source("s", "F", "bias", sigma="5 N", mean="0.1 kN"))
    assert (each.sigma.tolist(), each.mean.tolist()) == ([5.0] * 3, [100.0] * 3)
    assert read(source("s", "M", "saturation", limit="30 N*m")).settings["limit"].tolist() == [30.0] * 3
    part = read(source("s", "F", "bias", datasheet="±1 % FS", full_scale="300 N"))
    np.testing.assert_allclose(part.standard_deviation, 3 / np.sqrt(3))
    with pytest.raises(ExperimentError, match=r"source\[s\].sigma is '5 m': write a unit of the same dimension as N"):
        read(source("s", "F", "bias", sigma="5 m"))


def test_cross_talk_in_per_cent_of_full_scale_and_as_a_matrix():
    sigma = read(source("s", "wrench", "cross_talk", sigma="1 %", full_scale=FULL)).sigma
    full = np.array([300, 300, 500, 20, 20, 20])
    np.testing.assert_allclose(sigma, 0.01 * np.outer(full, 1 / full) * (1 - np.eye(6)))
    stated = read(source("s", "wrench", "cross_talk", datasheet="±1 % FS", full_scale=FULL))
    np.testing.assert_allclose(stated.standard_deviation, sigma / np.sqrt(3))
    row = ["1 %", "1 %", "1 %", "0.5 N/(N*m)", "0.5 N/(N*m)", "0.5 N/(N*m)"]
    other = ["1 mm", "1 N*mm/N", "1e-3 N*m/N", "1 %", "1 %", "1 %"]
    matrix = read(source("s", "wrench", "cross_talk", sigma=[row] * 3 + [other] * 3)).sigma
    np.testing.assert_allclose(matrix[0], [0.01] * 3 + [0.5] * 3)
    np.testing.assert_allclose(matrix[5], [0.001] * 3 + [0.01] * 3)


@pytest.mark.parametrize(("name", "ratio"), [("rectangular", 3), ("triangular", 6), ("u_shaped", 2)])
def test_a_half_width_over_its_root_is_the_standard_deviation(name, ratio):
    """Var = a²/3, a²/6, a²/2."""
    declared = experiment(source("a", "F", "bias", distribution=name, half_width=["1 N", "2 N", "3 N"])).sources[0]
    np.testing.assert_allclose(declared.sigma, np.array([1, 2, 3]) / np.sqrt(ratio), rtol=1e-12)
    np.testing.assert_allclose(declared.shape.standard_deviation, 1, rtol=1e-12)


def test_degrees_of_freedom_are_kept():
    assert read(BIAS | {"degrees_of_freedom": 9}).shape.degrees_of_freedom == 9
    assert read(BIAS).shape.degrees_of_freedom == np.inf
    t = read(source("s", "F", "bias", distribution="student_t", scale=["1 N"] * 3, degrees_of_freedom=5))
    assert t.shape.degrees_of_freedom == 5
    assert read(source("s", "F", "bias", datasheet="2 N, 95 %, 4 degrees of freedom")).shape.degrees_of_freedom == 4


OF_FULL_SCALE = (
    r"source\[s\].datasheet is in % of full scale, and a scale error is in % of the reading: write this limit over the "
    r"run's largest reading as '±… % of reading'; or as a zero, kind = \"bias\" with full_scale"
)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"target": "wrench", "kind": "bias"}, r"source\[s\].kind is 'bias': for wrench choose one of cross_talk, misal"),
        ({"kind": "delay"}, r"source\[s\].kind is 'delay': for F choose one of bias, coloured, drift, precision"),
        ({"target": "gravity", "kind": "drift"}, "gravity is one draw an experiment, write \"bias\""),
        ({"kind": "wobble"}, r"source\[s\].kind is 'wobble': choose one of bias, coloured"),
        ({"sigma": None}, r"missing key source\[s\].sigma: add it"),
        ({"sigma": None, "half_width": ["1 N"] * 3}, r"half_width needs a distribution between limits: add one \(rect"),
        ({"half_width": ["1 N"] * 3}, r"source\[s\].sigma and half_width both state the width: leave one out"),
        ({"distribution": "student_t"}, r"missing key source\[s\].degrees_of_freedom"),
        ({"distribution": "student_t", "degrees_of_freedom": 3}, r"missing key source\[s\].scale"),
        ({"degrees_of_freedom": 0}, r"source\[s\].degrees_of_freedom is 0: write more than zero"),
        ({"distribution": "samples"}, r"missing key source\[s\].samples: name the file"),
        ({"kind": "precision", "mean": ["1 N"] * 3}, r"unknown key source\[s\].mean"),
        ({"mean": ["1 N"]}, r"source\[s\].mean is \['1 N'\]: write three values"),
        ({"sigma": None, "datasheet": "0.1 % FS"}, r"source\[s\].datasheet is '0.1 % FS': give the full scale too"),
        ({"kind": "scale", "sigma": None, "datasheet": "0.1 % FS"}, OF_FULL_SCALE),
        ({"kind": "scale", "sigma": None, "datasheet": ["1 %", "1 %", "±1 % of full scale, k = 2"]}, OF_FULL_SCALE),
        ({"kind": "scale", "sigma": None, "datasheet": "±1 %", "full_scale": ["300 %"] * 3}, r"source\[s\].full_scale has no meaning here: leave it out"),
        ({"sigma": None, "datasheet": "0.1 % FS", "full_scale": ["0 N"] * 3}, r"full_scale\[0\] is '0 N': write a value above zero"),
        ({"sigma": None, "datasheet": ["1 N", "1 N"]}, "write one statement, or one for each axis"),
        ({"sigma": None, "datasheet": ["1 N", "1 N", "1 N, k = 2"]}, "states several distributions: write a source for each"),
        ({"sigma": None, "datasheet": "1 N", "distribution": "normal"}, "distribution is said by the datasheet's figure"),
        ({"sigma": None, "datasheet": "1 %", "kind": "scale", "degrees_of_freedom": 3}, "degrees_of_freedom is said by"),
        ({"correlation": [[1, 2, 0], [2, 1, 0], [0, 0, 1]]}, r"source\[s\].correlation is impossible"),
        ({"correlation": [[1, 0.5, 0], [0, 1, 0], [0, 0, 1]]}, r"source\[s\].correlation is no correlation matrix"),
        ({"correlation": [[1, 0], [0, 1]]}, r"source\[s\].correlation is .* write 3 rows of 3 finite numbers"),
        ({"distribution": "rectangular", "correlation": np.eye(3).tolist()}, "'s' is not normal, so it cannot be correlated"),
        ({"sigma": None, "kind": "quantisation", "step": ["1 N", "0 N", "1 N"]}, r"step\[1\] is '0 N': write a value above zero"),
        ({"sigma": None, "kind": "saturation"}, r"missing key source\[s\].limit"),
        ({"sigma": None, "kind": "coloured"}, r"missing key source\[s\].white: give white, flicker, random_walk"),
        ({"sigma": None, "kind": "coloured", "white": ["1 N"] * 3}, r"source\[s\].white\[0\] is '1 N': write a unit of"),
        ({"sigma": None, "kind": "coloured", "flicker": ["-1 N"] * 3}, r"source\[s\].flicker\[0\] is '-1 N': write zero"),
        ({"kind": "coloured", "white": ["1 N*s**0.5"] * 3}, r"unknown key source\[s\].sigma"),
        ({"target": "wrench", "kind": "cross_talk", "sigma": "1 %"}, r"missing key source\[s\].full_scale"),
        ({"target": "wrench", "kind": "cross_talk", "sigma": ["1 %"]}, "write six rows of six values, or one in %"),
        ({"target": "wrench", "kind": "cross_talk", "sigma": "1 %", "full_scale": ["1 N"] * 6}, r"full_scale\[3\] is '1 N'"),
    ],
)  # fmt: skip
def test_a_mistake_is_one_line_that_names_its_key(changed, message):
    written = {key: value for key, value in (BIAS | changed).items() if value is not None}
    with pytest.raises(ExperimentError, match=message) as caught:
        experiment(written)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("link", "message"),
    [
        ({"sources": ["s", "x"], "coefficient": 0.5}, "name two different ones of"),
        ({"sources": ["s", "s"], "coefficient": 0.5}, "name two different ones of"),
        ({"sources": "s", "coefficient": 0.5}, "correlation.0..sources is 's': name two of"),
        ({"sources": ["s", "t"]}, "missing key correlation.0..coefficient"),
        ({"sources": ["s", "t"], "coefficient": "0.5"}, "coefficient is '0.5': write a finite number"),
        ({"sources": ["s", "t"], "coefficient": 1.5}, "correlation of s, t is impossible"),
        ({"sources": ["s", "t"], "coefficient": [[1, 0], [0, 1]]}, "write 3 rows of 3 finite numbers"),
        ({"sources": ["s", "g"], "coefficient": 0.5}, "write 3 rows of 1 numbers"),
        ({"sources": ["s", "n"], "coefficient": 0.5}, "one is drawn at each sample, the other once"),
        ({"sources": ["s", "q"], "coefficient": 0.5}, "'q' is quantisation, which cannot be correlated"),
        ({"sources": ["s", "r"], "coefficient": 0.5}, "'r' is not normal"),
        ({"sources": ["s", "t"], "coefficient": 0.5, "why": 1}, "unknown key correlation.0..why"),
    ],
)
def test_a_mistake_in_a_correlation(link, message):
    others = [
        source("g", "gravity", "bias", sigma="1 m/s^2"),
        source("n", "F", "precision", sigma=["1 N"] * 3),
        source("q", "F", "quantisation", step=["1 N"] * 3),
        source("r", "F", "bias", distribution="rectangular", half_width=["1 N"] * 3),
    ]
    with pytest.raises(ExperimentError, match=message):
        experiment(BIAS, SCALE, *others, correlations=[link])


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "not a readable file beside the experiment"),
        (b"\xff\xfe", "not a readable file beside the experiment"),
        (b"1 2 3", "give 2 to 100,000 lines"),
        (b"1 2 3\n1 2 x", "write numbers, the same count in every line"),
        (b"1 2 3\n1 2", "write numbers, the same count in every line"),
        (b"1 2\n1 2", "has 2 columns: give 1, or 3, one per axis"),
        (b"1 2 3\n1 2 inf", "give 2 to 100,000 lines of finite numbers"),
        (b"", "give 2 to 100,000 lines of finite numbers"),
    ],
)
def test_a_file_of_samples_that_cannot_be_used(tmp_path, content, message):
    if content is not None:
        (tmp_path / "s.csv").write_bytes(content)
    with pytest.raises(ExperimentError, match=message):
        experiment(source("s", "F", "bias", distribution="samples", samples="s.csv", unit="N"), folder=tmp_path)
    (tmp_path / "s.csv").write_text("1\n2\n")
    with pytest.raises(ExperimentError, match=r"source\[s\].unit is 'kg'"):
        experiment(source("s", "F", "bias", distribution="samples", samples="s.csv", unit="kg"), folder=tmp_path)


# --- the example with an error of every kind ---


@pytest.fixture(scope="module")
def many():
    return Experiment.load(EXAMPLES / "many-errors.toml")


def test_the_example_has_every_kind_of_source(many):
    """But for those that act on samples alone, with which a campaign takes a hundred times as long."""
    on_sums = [pair for pair, kind in KINDS.items() if not isinstance(kind, ErrorByAct)]
    assert {s.kind for s in many.sources} == {kind for _, kind in on_sums}
    assert {s.target for s in many.sources} == {target for target, _ in on_sums}


@pytest.mark.slow
def test_the_example_runs(many, tmp_path, unjudged):
    result = montecarlo(many, trials=2, estimators="smoothed", plan=BY_SAMPLES)
    assert result["T1", "smoothed"].failed == 0
    provenance = result.to_dict()["provenance"]
    assert provenance["experiment"] == many.document
    json.dumps(provenance, allow_nan=False)
    write_report(result, tmp_path / "out")
    page = (tmp_path / "out" / "report.html").read_text("utf-8")
    for size in (
        "datasheet ±0.5 % FS",
        "half width 0.2 deg, 0.2 deg, 0.5 deg; distribution rectangular",
        "0.5 ms; mean 1 ms",
    ):
        assert size in page
    run = simulate(many).run
    steps = np.asarray(run.force) / [0.05, 0.05, 0.1]
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    found = identify([run], r_cg=many.r_cg_from_q, estimator=many.estimator("smoothed"))
    sigma = result["T1", "smoothed"].total.three_sigma / 3
    assert (np.abs(found.inertia - many.inertia) < 10 * sigma + 0.01).all()


def test_a_file_of_samples_is_found_beside_the_experiment(tmp_path, many):
    document = copy.deepcopy(tomllib.loads((EXAMPLES / "many-errors.toml").read_text("utf-8")))
    moved = Experiment.from_dict(document, EXAMPLES)
    np.testing.assert_array_equal(moved.sigma_r_cg, many.sigma_r_cg)
    rows = np.loadtxt(EXAMPLES / "many-errors-cg.csv", delimiter=",")
    np.testing.assert_allclose(many.sigma_r_cg, 1e-3 * rows.std(0))
    with pytest.raises(ExperimentError, match="not a readable file beside the experiment"):
        Experiment.from_dict(document, tmp_path)


def test_every_example_of_the_documentation_is_read():
    text = (EXAMPLES.parents[1] / "docs" / "reference" / "sources.md").read_text("utf-8")
    examples = [tomllib.loads(block) for block in re.findall(r"```toml\n(.*?)```", text, re.S)]
    assert len(examples) >= 2
    for example in examples:
        experiment(*example["source"], correlations=example.get("correlation", []))


def test_every_kind_is_documented():
    text = (EXAMPLES.parents[1] / "docs" / "reference" / "sources.md").read_text("utf-8")
    rows = [
        re.findall(r"`(\w+)`", cell)
        for line in text.splitlines()
        if line.startswith("| `")
        for cell in line.split("|")[1:3]
    ]
    said = {
        (target, kind)
        for targets, kinds in zip(rows[::2], rows[1::2], strict=True)
        for target in targets
        for kind in kinds
    }
    assert said == KINDS.keys()
