"""Expected values: reference bodies with their uncertainty, the comparison, and suspicions that are true."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
import scipy
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from identify.estimation.joint.prior_departure import declaration
from identify.identification import Identification
from identify.results.run_estimate import RunEstimate
from identify.rigid_body.inertial_parameters import InertialParameters, Tensor
from identify.rigid_body.rotation import from_axes
from identify.signals.estimator_spec import EstimatorSpec
from tests.helpers.changed_result import changed, ledger_of
from uq import compare, load_reference
from uq.bodies.normalised_error import joint_chi_squared, normalised_error
from uq.bodies.other_conventions import suspicions
from uq.bodies.reference import reference
from uq.report.tables.comparison import findings
from uq.runs.identification.tare import tared

PACKED = np.triu_indices(3)


def matrix(six):
    i11, i12, i13, i22, i23, i33 = six
    return np.array([[i11, i12, i13], [i12, i22, i23], [i13, i23, i33]])


def within(value, half, **more):
    return {"value": value, "tolerance": half, **more}


# A body from its drawing.

BAR = {
    "name": "bar",
    "part": [
        {
            "name": "bar",
            "shape": "cylinder",
            "diameter": within("76 mm", "0.1 mm"),
            "length": within("500 mm", ["-0.6 mm", "0.2 mm"], distribution="triangular"),
            "axis": "y",
            "density": {"value": "7.85 g/cm^3", "standard_uncertainty": "0.02 g/cm^3"},
            "position": ["1 mm", "0 mm", {"value": "53 mm", "expanded_uncertainty": "0.4 mm"}],
        }
    ],
}


def test_a_cylinders_uncertainty_is_that_of_draws(generator):
    """200,000 draws of its closed form; linear to 1e-3, and 1.96 standard errors of a standard deviation are 0.3 %."""
    found, n = reference(BAR).parameters, 200_000
    d = generator.uniform(0.0759, 0.0761, n)
    low, high = 0.4994, 0.5002
    length = generator.triangular(low, (low + high) / 2, high, n)
    mass = generator.normal(7850, 20, n) * np.pi / 4 * d**2 * length
    across, along = mass * (d**2 / 16 + length**2 / 12), mass * d**2 / 8
    r3 = generator.normal(0.053, 0.0002, n)
    draws = np.stack([mass, r3, across, along])
    np.testing.assert_allclose(found.values[[0, 3, 4, 7]], draws.mean(axis=1), rtol=1e-4)
    np.testing.assert_allclose(found.standard_uncertainty[[0, 3, 4, 7]], draws.std(axis=1), rtol=6e-3)
    correlation = found.covariance[0, 4] / np.prod(found.standard_uncertainty[[0, 4]])
    assert correlation == pytest.approx(np.corrcoef(mass, across)[0, 1], abs=5e-3)
    assert found.inertia[5] == pytest.approx(found.inertia[0], rel=1e-12)
    np.testing.assert_allclose(found.r_cg[:2], [0.001, 0], atol=1e-12)


def test_contributions_add_up():
    found = reference(BAR)
    total = sum(found.contributions.values())
    np.testing.assert_allclose(total, np.diag(found.parameters.covariance), rtol=1e-9, atol=1e-30)
    assert set(found.contributions) == {
        "part[bar].diameter", "part[bar].length", "part[bar].density", "part[bar].position[2]",
    }  # fmt: skip


def test_parts_share_the_bodys_mass_by_volume_and_a_hole_lacks_it():
    """A plate of 2 kg with a hole and a brass ball of known mass: by hand."""
    document = {
        "mass": "2 kg",
        "material": {"brass": {"density": "8500 kg/m^3"}},
        "part": [
            {"name": "plate", "shape": "cuboid", "size": ["200 mm", "100 mm", "10 mm"]},
            {"name": "hole", "shape": "cylinder", "diameter": "40 mm", "length": "10 mm", "hole": True},
            {"name": "ball", "shape": "sphere", "diameter": "20 mm", "material": "brass", "position": ["0 m", "30 mm", "0 m"]},
            {"name": "pin", "shape": "cylinder", "diameter": "5 mm", "length": "30 mm", "mass": "5 g", "rotation": "z, y, -x"},
        ],
    }  # fmt: skip
    ball, pin = 8500 * 4 / 3 * np.pi * 0.01**3, 0.005
    plate_volume, hole_volume = 0.2 * 0.1 * 0.01, np.pi * 0.02**2 * 0.01
    density = (2 - ball - pin) / (plate_volume - hole_volume)
    plate, hole = density * plate_volume, density * hole_volume
    y = ball * 0.03 / 2
    i33 = plate * (0.2**2 + 0.1**2) / 12 - hole * 0.02**2 / 2 + ball * (0.4 * 0.01**2 + 0.03**2)
    i33 += pin * (0.0025**2 / 4 + 0.03**2 / 12) - 2 * y**2
    found = reference(document).parameters
    np.testing.assert_allclose(found.values[[0, 1, 2, 3, 9]], [2, 0, y, 0, i33], rtol=1e-12, atol=1e-15)


def test_the_frame_places_and_turns_the_body(generator):
    frame = {
        "origin": ["10 mm", "-20 mm", within("30 mm", "0.1 mm")],
        "rotation_to_body": "y, z, x",
        "misalignment": ["0 deg", "0 deg", within("0 deg", "0.1 deg")],
    }
    plain, found = reference(BAR), reference({**BAR, "frame": frame})
    turn = np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0.0]])
    np.testing.assert_allclose(found.rotation, turn)
    np.testing.assert_allclose(found.parameters.r_cg, [0.01, -0.02, 0.03] + turn @ plain.parameters.r_cg)
    expected = turn @ matrix(plain.parameters.inertia) @ turn.T
    np.testing.assert_allclose(matrix(found.parameters.inertia), expected, atol=1e-15)
    gap = expected[0, 0] - expected[1, 1]  # a small turn about b3 makes I12 of it
    assert abs(gap) > 0.1
    assert found.parameters.standard_uncertainty[5] == pytest.approx(abs(gap) * np.radians(0.1) / np.sqrt(3), rel=1e-9)


# CAD reports: conventions.

TURN = Rotation.from_euler("ZYX", [50, -20, 35], degrees=True).as_matrix()
TENSOR = (TURN @ np.diag([0.11, 0.29, 0.36]) @ TURN.T)[PACKED]
MASS, CG, ORIGIN = 12.0, np.array([0.03, -0.05, 0.08]), np.array([0.01, 0.02, -0.04])
AXES = np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0.0]])
"""CAD's axes to the body's."""


def written(about, products, tensor=TENSOR, cg=CG):
    """The figures of a body as a CAD program writes them."""
    full = matrix(tensor) + (MASS * (cg @ cg * np.eye(3) - np.outer(cg, cg)) if about == "origin" else 0)
    signs = np.array([1, -1, -1, 1, -1, 1]) if products == "integral" else np.ones(6)
    return signs * full[PACKED]


def cad(figures, about="CG", products="tensor", frame=True, unit="kg*m^2", cg=CG):
    inertia = {name: f"{value!r} {unit}" for name, value in zip(("I11", "I12", "I13", "I22", "I23", "I33"), map(float, figures), strict=True)}  # fmt: skip
    report = {"about": about, "products": products, "inertia": inertia}
    report |= {"mass": f"{MASS} kg", "cg": [f"{float(x)!r} m" for x in cg]}
    placed = {"origin": [f"{float(x)!r} m" for x in ORIGIN], "rotation_to_body": "y, z, x"}
    return reference({"cad": report, **({"frame": placed} if frame else {})})


def measured(generator, tensor=TENSOR, axes=AXES, relative=1e-3):
    """A laboratory's tensor in B with its uncertainty, a part of the largest moment."""
    sigma = relative * np.abs(tensor).max()
    truth = (axes @ matrix(tensor) @ axes.T)[PACKED]
    return Tensor(truth + sigma * generator.normal(size=6), sigma**2 * np.eye(6))


BOTH_WAYS = [(about, products) for about in ("CG", "origin") for products in ("tensor", "integral")]


@pytest.mark.parametrize(("about", "products"), BOTH_WAYS)
def test_a_report_read_by_its_own_conventions_is_the_body(about, products):
    found = cad(written(about, products), about, products).parameters
    np.testing.assert_allclose(matrix(found.inertia), AXES @ matrix(TENSOR) @ AXES.T, atol=1e-14)
    np.testing.assert_allclose(found.r_cg, ORIGIN + AXES @ CG)


@pytest.mark.parametrize(("about", "products"), BOTH_WAYS)
@pytest.mark.parametrize("wrong", ["nothing", "products", "point", "products and point"])
def test_each_wrong_convention_is_named_and_the_right_one_names_nothing(generator, about, products, wrong):
    said_products = products if "products" not in wrong else {"tensor": "integral", "integral": "tensor"}[products]
    said_about = about if "point" not in wrong else {"CG": "origin", "origin": "CG"}[about]
    found = suspicions(measured(generator), cad(written(about, products), said_about, said_products))
    assert [one.cause for one in found] == ([] if wrong == "nothing" else [wrong])
    for one in found:
        assert one.remaining < 0.05
        assert f'"{products}"' in one.text or wrong == "point"
        assert f'"{about}"' in one.text or wrong == "products"


def test_each_assignment_of_axes_is_named_with_the_cure(generator):
    """The 24 rotations of a cube: the file's axes are wrong by one of them, and the text says the right ones."""
    turns, report = Rotation.create_group("O").as_matrix().round(), cad(written("CG", "tensor"))
    assert len(turns) == 24
    for turn in turns:
        truth = AXES @ turn
        found = suspicions(measured(generator, axes=truth), report)
        if np.array_equal(turn, np.eye(3)):
            assert found == ()
            continue
        (one,) = found
        assert one.cause == "axes"
        cured = one.text.split('rotation_to_body = "')[1].rstrip('"')
        again = from_axes(cured)
        np.testing.assert_allclose(again @ matrix(TENSOR) @ again.T, truth @ matrix(TENSOR) @ truth.T, atol=1e-12)


@pytest.mark.parametrize(
    ("unit", "factor"), [("g*mm^2", 1e9), ("kg*mm^2", 1e6), ("g*m^2", 1e3), ("lb*inch^2", 3417.17)]
)
def test_a_wrong_unit_is_named(generator, unit, factor):
    """Figures in ``unit``, declared as kg·m²."""
    (one,) = suspicions(measured(generator), cad(factor * written("CG", "tensor")))
    assert one.cause == "unit"
    assert unit.replace("*", "·").replace("^2", "²").replace("inch", "in") in one.text


@pytest.mark.parametrize(("component", "factor"), [(3, -1.0), (0, 0.1), (2, 100.0)])
def test_a_slip_of_sign_or_decimal_point_is_named(generator, component, factor):
    """A negative moment is no body's, and compared all the same."""
    slipped = written("CG", "tensor") * np.where(np.arange(6) == component, factor, 1.0)
    (suspicion,) = suspicions(measured(generator), cad(slipped))
    assert suspicion.cause == "slip"
    name = ("I11", "I12", "I13", "I22")[component]
    assert f"its {name} is multiplied by {1 / factor:g}" in suspicion.text


@pytest.mark.parametrize("products", ["tensor", "integral"])
def test_of_a_diagonal_body_nothing_false_is_said(generator, products):
    """Signs of products that are zero, axes of a body of revolution, a point that is the CG: none can be told."""
    tensor = np.array([0.38, 0, 0, 0.0185, 0, 0.38])
    for turn in (np.eye(3), [[0, 0, 1], [0, -1, 0], [1, 0, 0.0]], np.diag([-1.0, 1, -1])):
        one = cad(tensor, products=products, cg=np.zeros(3))
        assert suspicions(measured(generator, tensor, AXES @ np.array(turn)), one) == ()
    heavier = measured(generator, 1.05 * tensor)
    assert np.abs(normalised_error(heavier, cad(tensor).parameters.tensor)).max() > 1
    assert suspicions(heavier, cad(tensor, products=products)) == ()


def test_a_plain_deviation_has_no_suspicion(generator):
    """200 bodies whose deviation is real, of 5 %: none is explained away."""
    named, report = 0, cad(written("CG", "tensor"))
    for _ in range(200):
        off = TENSOR * (1 + 0.05 * generator.normal(size=6))
        named += len(suspicions(measured(generator, off), report))
    assert named == 0


def test_what_leaves_more_than_a_third_of_the_deviation_is_not_named():
    """Cyclic axes bring every |E_n| from 2.1 to 0.7, but the deviation only from 4.2 to 2.4 g·m²."""
    figures = 1e-3 * np.array([380.0, 0, 0, 382.8, 0, 381.4])
    one = Tensor(figures + [4.2e-3, 0, 0, 0, 0, 0], 1e-6 * np.eye(6))
    report = cad(figures, frame=False)
    assert joint_chi_squared(one, report.parameters.tensor)[2] < 0.01
    assert suspicions(one, report) == ()


def test_of_a_drawing_only_the_axes_are_suspected(generator):
    bar = reference({**BAR, "frame": {"rotation_to_body": "x, y, z"}})
    truth = bar.parameters.inertia
    swapped = measured(generator, truth, AXES)
    assert [one.cause for one in suspicions(swapped, bar)] == ["axes"]
    assert suspicions(measured(generator, truth, np.eye(3)), bar) == ()


def test_exact_figures_on_both_sides():
    one = Tensor(TENSOR, np.zeros((6, 6)))
    plain, other = cad(TENSOR, frame=False), cad(written("CG", "integral"), frame=False)
    assert suspicions(one, plain) == ()
    assert [s.cause for s in suspicions(one, other)] == ["products"]
    assert joint_chi_squared(one, plain.parameters.tensor) == (0.0, 0, 1.0)


def test_without_mass_and_centre_the_tensor_is_still_compared(generator):
    figures = written("CG", "integral")
    inertia = {name: f"{float(value)!r} kg*m^2" for name, value in zip(("I11", "I12", "I13", "I22", "I23", "I33"), figures, strict=True)}  # fmt: skip
    bare = reference({"cad": {"about": "CG", "products": "tensor", "inertia": inertia}})
    assert np.isnan(bare.parameters.values[:4]).all()
    assert [one.cause for one in suspicions(measured(generator, axes=np.eye(3)), bare)] == ["products"]


def test_figures_that_are_no_bodys_as_they_are_read_are_a_finding(generator):
    """A wrong sign or point often makes an impossible tensor: it is compared all the same, so that the cause is named."""
    for about, products, cause in (("CG", "integral", "products"), ("origin", "tensor", "point")):
        wrong = cad(written("CG", "tensor"), about, products, frame=False)
        assert "is no body" in wrong.warnings[0]
        found = compare(identified(measured(generator, axes=np.eye(3))), wrong)
        assert "is no body" in findings(found)[0]
        assert [one.cause for one in found.suspicions] == [cause]


# The comparison.


def identified(tensor, repeats=(), mass=None):
    runs = tuple(
        RunEstimate(f"{k}.mcap", None, row, np.ones(6), 1000, 400.0, np.ones(3), 0.0, None, True)
        for k, row in enumerate(repeats)
    )
    of_mass = np.nan if mass is None else 1e-6
    covariance = scipy.linalg.block_diag(of_mass, 1e-8 * np.eye(3), tensor.covariance)
    ten = InertialParameters(np.nan if mass is None else mass, np.array([0.0, 0, 0.053]), tensor.inertia, covariance)
    intervals = ten.values[:, None] + 2 * ten.standard_uncertainty[:, None] * np.array([[-1, 1]])
    return Identification(
        ten.values, ledger_of(ten.values, covariance, intervals), EstimatorSpec("central", "central"), runs, (), (), {}
    )


SOURCE = {
    "name": "the paper's cylinder",
    "cad": {"about": "CG", "products": "tensor", "inertia": {"I11": {"value": "382.89 g*m^2", "standard_uncertainty": "1 g*m^2"}, "I22": "18.72 g*m^2", "I33": "380.66 g*m^2"}},
}  # fmt: skip
MEAN = 1e-3 * np.array([387.24, 1.19, 1.20, 18.30, -1.78, 380.99])


def test_the_sources_table_3_as_a_laboratory_compares_it(generator):
    spread = 1e-3 * np.array([0.22, 1.79, 0.15, 0.01, 0.21, 0.48])
    z = generator.normal(size=(5, 6))
    repeats = MEAN + spread * (z - z.mean(axis=0)) / z.std(axis=0, ddof=1)
    result = identified(Tensor(MEAN, np.diag(spread**2 / 5)), repeats)
    found = compare(result, reference(SOURCE))
    np.testing.assert_allclose(found.mean, MEAN)
    np.testing.assert_allclose(found.standard_deviation, spread)
    np.testing.assert_allclose(1e3 * found.deviation, [4.35, 1.19, 1.20, -0.42, -1.78, 0.33], atol=1e-9)
    assert found.relative_error[0] == pytest.approx(4.35 / 382.89)
    assert np.isnan(found.relative_error[1])
    u = np.hypot(1e-3, spread[0] / np.sqrt(5))
    assert found.normalised_error[0] == pytest.approx(4.35e-3 / (2 * u))
    assert found.suspicions == ()
    assert "I11, I13, I22, I23 differ from the paper's cylinder beyond" in findings(found)[0]
    text = repr(found)
    assert "387.2" in text
    assert "1.14" in text
    json.dumps(found.to_dict(), allow_nan=False)
    assert found.to_dict()["relative_error"]["I12"] is None


def test_few_runs_count_with_the_interval_that_they_have():
    """Half intervals of 12.7 u, as two runs give them, and of 4 u for the mass: E_n is so much smaller."""
    result = identified(Tensor(MEAN, 1e-8 * np.eye(6)), mass=MASS + 0.004)
    half = 12.7 * 1e-4 * np.array([[-1, 1]])
    intervals = np.vstack([result.intervals95[:4], MEAN[:, None] + half])
    intervals[0] = result.mass + 4 * 1e-3 * np.array([-1, 1])
    wide = changed(result, intervals95=intervals)
    exact = cad(written("CG", "tensor"), frame=False)
    narrow, found = compare(result, exact), compare(wide, exact)
    np.testing.assert_allclose(found.normalised_error, narrow.normalised_error * 2 / 12.7)
    assert found.other_errors["mass"] == pytest.approx(narrow.other_errors["mass"] / 2)


def test_joint_chi_squared_has_its_distribution(generator):
    """2,000 measurements of a correlated reference: the probability is uniform (Kolmogorov–Smirnov at 1e-3: 0.0436)."""
    draw = generator.normal(size=(6, 6))
    spread, own = 1e-6 * draw @ draw.T, 1e-6 * np.diag([1.0, 2, 3, 1, 2, 3])
    expected = Tensor(TENSOR, spread)
    roots = np.linalg.cholesky(spread), np.sqrt(own)
    probabilities = []
    for _ in range(2000):
        off = roots[0] @ generator.normal(size=6) + roots[1] @ generator.normal(size=6)
        statistic, freedom, probability = joint_chi_squared(Tensor(TENSOR + off, own), expected)
        assert freedom == 6
        assert probability == pytest.approx(chi2.sf(statistic, 6))
        probabilities.append(probability)
    distance = np.abs(np.sort(probabilities) - (np.arange(2000) + 0.5) / 2000).max()
    assert distance < 0.0436


def test_mass_and_centre_are_compared_where_both_sides_know_them(generator):
    result = identified(Tensor(TENSOR, 1e-6 * np.eye(6)), mass=MASS + 0.004)
    document = dataclasses.replace(cad(written("CG", "tensor"), frame=False))
    errors = compare(result, document).other_errors
    assert errors["mass"] == pytest.approx(2.0)
    assert errors["cg_z"] == pytest.approx((0.053 - 0.08) / 2e-4)
    assert "mass" not in compare(identified(Tensor(TENSOR, 1e-6 * np.eye(6))), document).other_errors


def test_a_mass_that_is_declared_as_exact_has_no_normalised_error():
    """It is no measurement: the deviation of a declared mass from the drawing's is said, in its own words."""
    result = changed(identified(Tensor(TENSOR, 1e-6 * np.eye(6)), mass=MASS + 0.4), mass_uncertainty=None)
    found = compare(result, dataclasses.replace(cad(written("CG", "tensor"), frame=False)))
    assert set(found.other_errors) == {"cg_x", "cg_y", "cg_z"}
    (line,) = [text for text in findings(found) if text.startswith("mass")]
    assert line.startswith(f"mass is {MASS + 0.4:g} kg, declared without an uncertainty (no E_n); ")
    same = changed(result, mass=MASS)
    assert not any(text.startswith("mass") for text in findings(compare(same, found.reference)))


def test_repeats_are_without_the_fixture(generator):
    """A tare takes the same off every run: the mean of the runs stays the result."""
    whole = MEAN + [0.1, 0, 0, 0.1, 0, 0.1]
    repeats = whole + 1e-4 * np.array([-1, 0, 1])[:, None]
    result = identified(Tensor(whole, 1e-8 * np.eye(6)), repeats, mass=19.0)
    fixture = InertialParameters(2.0, np.array([0, 0, 0.01]), np.array([0.02, 0, 0, 0.02, 0, 0.03]), np.zeros((10, 10)))
    body = tared(result, fixture)
    found = compare(body, reference(SOURCE))
    np.testing.assert_allclose(found.mean, body.inertia)
    np.testing.assert_allclose(found.standard_deviation, 1e-4)


def test_what_the_runs_contradict_passes_no_comparison():
    result = identified(Tensor(MEAN, 1e-3 * np.eye(6)), MEAN[None])
    off = declaration("mass", 0, 19.8, 19.7, 0.01)
    sound, contradicted = (
        repr(compare(dataclasses.replace(result, declarations=records), reference(SOURCE))) for records in ((), (off,))
    )
    assert "all components together: chi-squared" in sound
    assert "chi-squared" not in contradicted
    assert "are meaningless: the runs contradict what is declared of mass (10.0 u off)" in contradicted


def test_a_single_run_has_no_standard_deviation():
    found = compare(identified(Tensor(MEAN, 1e-8 * np.eye(6)), MEAN[None]), reference(SOURCE))
    assert np.isnan(found.standard_deviation).all()
    assert found.to_dict()["standard_deviation_of_runs"]["I11"] is None
    assert "–" in repr(found)


def test_the_files_of_the_docs():
    """Their figures as docs/how-to/compare-with-a-drawing.md has them; the CAD report is a body's."""
    folder = Path(__file__).parents[3] / "uq" / "examples"
    bar = load_reference(folder / "cylinder.toml").parameters
    np.testing.assert_allclose(1e3 * bar.inertia[[0, 3]], [379.37, 12.915], atol=5e-3)
    np.testing.assert_allclose(1e3 * bar.standard_uncertainty[[4, 7]], [0.27, 0.005], rtol=0.07)
    assert load_reference(folder / "cad-report.toml").warnings == ()
