"""What undeclared errors add at typical figures, to conventional bounds: against a laboratory that has these errors.

The judges are least squares in their plainest form (tests/helpers/troubles.py) and the joint estimate of spoiled recordings.
"""

import json
from dataclasses import replace

import numpy as np
import pytest

from identify import identification
from identify.estimation.joint import single_run
from identify.results.declaration import ResidualCause
from identify.results.ledger import QUANTITIES, Ledger
from tests.helpers.changed_result import changed, not_judged, typical, with_typical
from tests.helpers.laboratory import Setup, cell_reading, measure
from tests.helpers.laboratory_files import document, identified_files, source
from tests.helpers.laboratory_runs import identified, run_of
from tests.helpers.troubles import least_squares
from uq.experiment.experiment import Experiment
from uq.report.certificate.certificate import Certificate
from uq.report.tables.identification import undeclared_tables
from uq.runs.identification.undeclared import noted, with_undeclared

SHORT = {"seconds": 15.0}
UNIT = np.eye(6)


def added(result):
    """What each adds to the ten parameters, by name."""
    return {effect.error: effect.parameters for effect in result.undeclared.rows}


def ten(result):
    return np.concatenate([[result.mass], result.r_cg, result.inertia])


def looked_at(measured, method):
    """The result of arrays with what it does not include."""
    experiment = Experiment.from_dict(document(measured, method))
    return with_undeclared(identified(measured, method), [run_of(measured)], experiment)


def axes(option, size, count=3):
    """The options of as many laboratories, an axis each."""
    return [{option: tuple(size * unit[:count])} for unit in UNIT[:count]]


@pytest.fixture(scope="module")
def measured():
    return measure(1, **SHORT)


@pytest.fixture(scope="module")
def by_source(measured, tmp_path_factory):
    return identified_files(measured, tmp_path_factory.mktemp("source"))


@pytest.fixture(scope="module")
def of_arrays(measured):
    return identified(measured)


@pytest.fixture(scope="module")
def silent():
    return measure(1, noise=0.0, drawn=0.0, **SHORT)


def spoiled(silent, options):
    """The run with a trouble; those of the load cell by what it makes of the same wrench."""
    if not {"cell_gain", "cell_turn", "cross_talk"} & set(options):
        return measure(1, silent.setup, **options)
    wrench = cell_reading(Setup(**options), np.hstack([silent.force, silent.moment]), silent.t_wrench)
    return replace(silent, force=wrench[:, :3], moment=wrench[:, 3:])


def talk(measured, part):
    """A laboratory for each of thirty ways from one component to another."""
    size = np.repeat([np.abs(measured.force).max(), np.abs(measured.moment).max()], 3)
    return [
        {"cross_talk": part * np.outer(UNIT[i], UNIT[j]) * size[i] / size[j]}
        for i in range(6)
        for j in range(6)
        if i != j
    ]


SMALLER = 20
"""The square of 1 ms does a third as much to a moment as 1 ms to a product: a twentieth of it is tried."""
TROUBLES = {
    "force_gain": lambda _: [{"cell_gain": (0.0025,) * 3 + (0.0,) * 3}],
    "force_gain_by_axis": lambda _: [{"cell_gain": tuple(0.0025 * unit)} for unit in UNIT[:3]],
    "moment_gain": lambda _: [{"cell_gain": (0.0,) * 3 + (0.0025,) * 3}],
    "moment_gain_by_axis": lambda _: [{"cell_gain": tuple(0.0025 * unit)} for unit in UNIT[3:]],
    "cross_talk": lambda measured: talk(measured, 0.0015),
    "load_cell_axes": lambda _: axes("cell_turn", 0.005),
    "gyro_scale": lambda _: axes("gyro_scale", 0.003),
    "gyro_axes": lambda _: axes("gyro_turn", 0.005),
    "delay": lambda _: [{"imu_delay": 0.001 / SMALLER}],
    "mounting_frequency": lambda _: [{"flex_frequency": 50.0}],
}


@pytest.mark.parametrize("name", TROUBLES)
def test_least_squares_is_off_as_the_table_says(name, measured, silent, by_source):
    """Root sum of squares over axes; noise, smoother and what is left out at the ends differ: 3 % of the largest.

    Twice that of a delay, to most of which least squares is blind.
    """
    clean = least_squares(silent)
    shifts = np.array([least_squares(spoiled(silent, options)) - clean for options in TROUBLES[name](measured)])
    off = shifts[0] if name == "mounting_frequency" else np.linalg.norm(shifts, axis=0)
    off, within = (off * SMALLER, 0.06) if name == "delay" else (off, 0.03)
    np.testing.assert_allclose(added(by_source)[name][4:], off, atol=within * np.abs(off).max())


@pytest.mark.slow  # by its derivative: test_declared_gls.py
def test_generalised_least_squares_is_off_as_the_table_says(measured, monkeypatch):
    """Its weights are learnt anew from the spoiled recording: 7 % of the largest."""
    result = looked_at(measured, "gls")
    monkeypatch.setattr(identification, "judged", not_judged)
    clean = identified(measured, "gls").inertia
    shifts = [
        identified(replace(measured, omega=measured.omega * (1 + 0.003 * unit)), "gls").inertia - clean
        for unit in np.eye(3)
    ]
    off = np.linalg.norm(shifts, axis=0)
    np.testing.assert_allclose(added(result)["gyro_scale"][4:], off, atol=0.07 * off.max())


class Refit:
    """The joint estimate of spoiled recordings: its weights are those of the first one that it sees, or learnt anew."""

    NAMES = ("residual_noise", "noise_spectrum")

    def __init__(self, monkeypatch):
        self.patch, self.learnt_weights = monkeypatch, {}
        self.learn = {name: getattr(single_run, name) for name in self.NAMES}

    def by_first(self, name):
        return lambda *arguments, **options: self.learnt_weights.setdefault(
            name, self.learn[name](*arguments, **options)
        )

    def off(self, plain, measured, **options):
        """By how much the ten parameters move, its weights kept; anew, they move by a tenth of u more at most.

        The table is the derivative of the estimate. Weights learnt anew weigh the noise of the recording otherwise, too,
        which moves the estimate by 0.06 u here.
        """
        with self.patch.context() as patch:
            patch.setattr(identification, "judged", not_judged)
            anew = ten(identified(measured, "joint", **options)) - ten(plain)
            for name in self.NAMES:
                patch.setattr(single_run, name, self.by_first(name))
            off = ten(identified(measured, "joint", **options)) - ten(plain)
        assert (np.abs(anew - off)[1:] <= 0.1 * plain.parameters.standard_uncertainty[1:]).all()
        return off


@pytest.fixture
def refit(monkeypatch):
    return Refit(monkeypatch)


@pytest.fixture(scope="module")
def still():
    return measure(1, still=True, **SHORT)


@pytest.fixture(scope="module")
def jointly(still):
    return looked_at(still, "joint")


def test_the_joint_estimate_is_off_as_the_table_says(still, jointly, refit):
    """With its centre of gravity: within 4 % of the largest where the error is small, a tenth of the gyro's, and 200 Hz."""
    assert not refit.off(jointly, still).any()
    scale = 5e-4 * np.array([1.0, -1.0, 1.0])
    by_scale = jointly.by_held_errors["gyro_scale"]
    np.testing.assert_allclose(added(jointly)["gyro_scale"], 0.003 * np.linalg.norm(by_scale, axis=1))
    stiff = added(jointly)["mounting_frequency"] / 16
    for options, expected in (({"gyro_scale": tuple(scale)}, by_scale @ scale), ({"flex_frequency": 200.0}, stiff)):
        off = refit.off(jointly, measure(1, still.setup, **options))
        for rows in (slice(1, 4), slice(4, 10)):
            atol = max(0.04 * np.abs(expected[rows]).max(), 5e-7)
            np.testing.assert_allclose(off[rows], expected[rows], atol=atol)


@pytest.mark.slow  # of every error alone: test_error_models.py
def test_the_joint_estimate_depends_on_the_accelerometers_place_and_on_the_gyros_axes(measured, monkeypatch):
    """A tenth of the typical 2 mm and 5 mrad on each axis, in the laboratory: a tenth of the largest, weights learnt
    anew; 5 % of the tensor's by the place.
    """
    result = looked_at(measured, "joint")
    monkeypatch.setattr(identification, "judged", not_judged)
    for option, step, name in (("imu_position_error", 2e-4, "accelerometer_place"), ("gyro_turn", 5e-4, "gyro_axes")):
        moved = [identified(measure(1, **{option: tuple(step * unit)}, **SHORT), "joint") for unit in np.eye(3)]
        off = 10 * np.linalg.norm([ten(one) - ten(result) for one in moved], axis=0)
        for rows, within in ((slice(1, 4), 0.1), (slice(4, 10), 0.05 if name == "accelerometer_place" else 0.1)):
            np.testing.assert_allclose(added(result)[name][rows], off[rows], atol=within * off[rows].max())
    # it scales what the accelerometer reads, not the specific force at the centre of gravity
    scaled = [replace(measured, acceleration=measured.acceleration * (1 + 3e-4 * unit)) for unit in np.eye(3)]
    off = 10 * np.linalg.norm([ten(identified(run, "joint")) - ten(result) for run in scaled], axis=0)
    np.testing.assert_allclose(added(result)["accelerometer_scale"][4:], off[4:], atol=0.1 * off[4:].max())


def test_an_unknown_is_not_there(by_source, jointly):
    """By least squares gravity does nothing; of the joint estimate delay and, without accelerometer, axes are unknowns."""
    assert by_source.warnings == ()
    assert set(added(by_source)) == {*TROUBLES, "mass"}
    assert set(added(jointly)) == {*TROUBLES, "gravity", "mass"} - {"delay", "gyro_axes"}


def again(result, measured, without=(), sources=(), **own):
    """What undeclared errors add with these sources, without others, and with an experiment's own figures."""
    content = document(measured, sources=sources) | {"undeclared": own}
    content["source"] = [table for table in content["source"] if table["name"] not in without]
    return added(with_undeclared(result, [run_of(measured)], Experiment.from_dict(content)))


def test_what_is_declared_is_not_there(by_source, measured):
    declared = [source("g", "omega", "scale", [0.3] * 3), source("c", "wrench", "cross_talk", 5e-3)]
    assert set(again(by_source, measured, sources=declared)) == {*TROUBLES, "mass"} - {"gyro_scale", "cross_talk"}


def test_the_experiment_has_its_own_figures(by_source, measured):
    """Half the gain is half the effect, twice the frequency a quarter, false is none; an exact r_CG has its price."""
    usual = again(by_source, measured)
    names = ("force_gain_by_axis", "cross_talk", "moment_gain", "moment_gain_by_axis", "load_cell_axes", "gyro_scale",
             "gyro_axes", "delay", "mass")  # fmt: skip
    own = {"force_gain": "0.125 %", "mounting_frequency": "100 Hz"} | dict.fromkeys(names, False)
    exact = changed(by_source, sigma_r_cg=np.zeros(3))
    ours = again(exact, measured, without=("r_cg",), **own)
    assert set(ours) == {"force_gain", "mounting_frequency", "centre_of_gravity"}
    np.testing.assert_allclose(ours["force_gain"], usual["force_gain"] / 2, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(ours["mounting_frequency"], usual["mounting_frequency"] / 4, rtol=1e-12)
    by_axis = [least_squares(replace(measured, r_cg=measured.r_cg + 1e-3 * unit)) for unit in np.eye(3)]
    off = np.linalg.norm(np.array(by_axis) - least_squares(measured), axis=0)
    np.testing.assert_allclose(ours["centre_of_gravity"][4:], off, atol=0.03 * off.max())


def test_where_all_is_declared_nothing_is_left_out(by_source, measured):
    """But gravity, to which least squares are blind: nothing is left to be computed."""
    by_source = changed(by_source, mass_uncertainty=0.01)
    names = {"gyro_axes": ("omega", "misalignment"), "load_cell_axes": ("wrench", "misalignment"), "gyro_scale": ("omega", "scale"),
             "force_gain": ("F", "scale"), "moment_gain": ("M", "scale")}  # fmt: skip
    declared = [source(name, *pair, [0.3] * 3) for name, pair in names.items()]
    declared += [source("talk", "wrench", "cross_talk", 5e-3), source("late", "omega", "delay", 1e-3)]
    content = document(measured, sources=declared) | {"undeclared": {"mounting_frequency": False}}
    result = with_undeclared(by_source, [run_of(measured)], Experiment.from_dict(content))
    assert result.undeclared.rows == ()
    assert undeclared_tables(result) == []
    assert not any(note.startswith("undeclared") for note in result.notes())


def effect(name, values, signed=False):
    return typical(name, 1e-3 * np.array(values)[:, None], signed=signed)


def test_all_ten_together_are_a_root_sum_of_squares_and_the_mass_counts():
    both = Ledger((effect("a", [3.0, 0, 0, 0, 3, 0, 0, 0, 0, 0]), effect("b", [-4.0, 0, 0, 0, 4, 0, 0, 0, 0, 0], True)))
    u = 1e-3 * np.array([1.0, 1, 1, 1, 50, 1, 1, 1, 1, 1])
    np.testing.assert_allclose(both.standard_uncertainty, 1e-3 * np.array([5.0, 0, 0, 0, 5, 0, 0, 0, 0, 0]))
    assert both.covariance[0, 4] == pytest.approx(9e-6 - 16e-6)
    assert both.share(u) == (pytest.approx(5.0), 0)
    assert both.largest(u)[1:] == (0, pytest.approx(16 / 26))
    u[0] = np.nan
    assert both.share(u) == (pytest.approx(0.1), 4)
    assert both.largest(u)[1:] == (4, pytest.approx(16 / 2525))
    assert Ledger(()).share(u)[0] == 0
    assert Ledger(()).largest(u) is None


def test_the_conventional_bound_holds_both_kinds_of_errors(by_source):
    """Squares of the interval's arms and of 2 u of undeclared errors add; with nothing undeclared both are one."""
    added, middle = by_source.undeclared, by_source.inertia[:, None]
    of_interval, of_bound = (ends - middle for ends in (by_source.interval95, by_source.conventional_bound))
    squares = of_bound**2 - of_interval**2
    np.testing.assert_allclose(squares, 4 * np.diag(added.covariance)[4:, None] * [1, 1], rtol=1e-5)
    beyond = by_source.with_undeclared.covariance - by_source.parameters.covariance - added.covariance
    np.testing.assert_allclose(np.nan_to_num(beyond), 0, atol=1e-15)
    complete = with_typical(by_source, [])
    np.testing.assert_array_equal(complete.conventional_bound, by_source.interval95)
    assert with_typical(by_source, None).conventional_bound is None


@pytest.mark.parametrize(("cause", "has_typical_size"), [("gyro scale", False), ("gain", True)])
def test_what_the_runs_tell_of_an_error_takes_the_place_of_its_typical_size(
    measured, of_arrays, cause, has_typical_size
):
    """Of a gain the runs tell a part of its six numbers alone."""
    named = replace(of_arrays, consistency=(ResidualCause(cause, "b1", 0.5, "", changes=(0.0,) * 10),))
    added = with_undeclared(named, [run_of(measured)], Experiment.from_dict(document(measured, "source"))).undeclared
    name = {"gyro scale": "gyro_scale", "gain": "moment_gain"}[cause]
    assert (name in [row.error for row in added.rows if row.changes[4:].any()]) is has_typical_size


def test_a_small_cause_is_a_note_where_the_mass_is_not_known_either(by_source):
    """Only what is known counts: the mass has no interval."""
    cause = ResidualCause("gyro scale", "b1", 0.0, "small", changes=(0.0,) * 10)
    unknown = by_source.parameters.covariance.copy()
    unknown[0, 0] = np.nan
    for result in (by_source, changed(by_source, mass=np.nan, covariance_of_ten=unknown)):
        (noted_cause,) = noted(replace(result, consistency=(cause,)), result.ledger.of_tiers("typical"))
        assert noted_cause.note


@pytest.mark.slow  # by least squares: the_experiment_has_its_own_figures; jointly: the_joint_estimate
def test_an_exact_mass_and_centre_err_as_the_table_says(still, refit):
    """The joint estimate keeps both as stated: against one with another mass or, a tenth as far off, centre; 4 % of the largest."""
    content = document(still, "joint")
    content["source"] = [table for table in content["source"] if table["name"] != "r_cg"]
    exact = {"sigma_r_cg": np.zeros(3)}
    plain = identified(still, "joint", **exact)
    result = with_undeclared(plain, [run_of(still)], Experiment.from_dict(content))
    changes = {effect.error: effect.changes for effect in result.undeclared.rows}
    assert not refit.off(plain, still, **exact).any()
    for stated, expected in (
        ({"mass": 1.001 * still.mass}, changes["mass"][:, 0]),
        ({"r_cg": still.r_cg + [0, 1e-4, 0]}, 0.1 * changes["centre_of_gravity"][:, 1]),
    ):
        off = refit.off(plain, still, **(exact | stated))
        for rows in (slice(0, 1), slice(1, 4), slice(4, 10)):
            atol = max(0.04 * np.abs(expected[rows]).max(), 5e-7)
            np.testing.assert_allclose(-off[rows], expected[rows], atol=atol)
    wide = result.with_undeclared.standard_uncertainty
    np.testing.assert_allclose(wide[:4], [1e-3 * still.mass, 1e-3, 1e-3, 1e-3], rtol=1e-6)


def test_a_singular_estimate_has_no_figure(by_source):
    """A change of the mass by 1e137 kg is no price of an error."""
    huge = effect("mass", [1e140, 0, 0, 0, 0.1, 0, 0, 0, 0, 0])
    result = with_typical(changed(by_source, mass_uncertainty=1e-3), [huge])
    _, *row = undeclared_tables(result)[0].rows[0]
    assert (row[1], row[5]) == ("–", "0.10")
    assert result.overview()[1].rows[0][-1] == "not determined"


def test_it_is_said_in_a_line_in_result_json_and_on_the_certificate(by_source):
    (line,) = (note for note in by_source.notes() if note.startswith("undeclared"))
    gap = by_source.undeclared.largest(by_source.parameters.standard_uncertainty)
    assert f"{100 * gap.share:.0f} % of u² of {QUANTITIES[gap.parameter][0]}" in line
    content = json.loads(json.dumps(by_source.to_dict()))
    rows = {row["name"]: row["inertia"]["I33"] for row in content["undeclared"]}
    assert content["not_included"] == content["undeclared"]  # the old name, for whoever reads files of version 1
    assert rows["moment_gain"] == pytest.approx(0.96e-3, rel=0.02)
    np.testing.assert_allclose(content["conventional_bound"]["I33"], by_source.conventional_bound[5])
    (table,) = (table for table in Certificate(by_source).details() if table.caption.startswith("Undeclared errors"))
    assert [row[0] for row in table.rows][:2] == ["common gain of the force", "gain of each force"]
    assert table.caption in [entry.caption for entry in by_source.tables()]
    assert "conventional bound, k = 2" in by_source.tables()[0].head


def test_arrays_say_how_large_the_conventional_bound_is_at_least(of_arrays):
    """By a scale of the gyro of 0.3 %, by which the whole tensor is off: twice it."""
    (line,) = (note for note in of_arrays.notes() if note.startswith("undeclared errors"))
    assert f"± {2 * 3 * np.abs(of_arrays.inertia).max():.1f} g·m² to I33; uq.with_undeclared" in line
