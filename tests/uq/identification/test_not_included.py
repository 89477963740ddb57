"""What the intervals do not hold, at typical figures: against a laboratory that has these errors.

The judges are least squares in their plainest form (tests/helpers/troubles.py) and the joint estimate of spoiled recordings.
"""

import json
from dataclasses import replace

import numpy as np
import pytest

from identify import identification
from identify.results.contributions import Effect, NotIncluded
from tests.helpers.laboratory import Setup, cell_reading, measure
from tests.helpers.laboratory_files import document, identified_files, source
from tests.helpers.laboratory_runs import identified, run_of
from tests.helpers.troubles import least_squares
from uq.experiment.experiment import Experiment
from uq.identification.not_included import with_not_included
from uq.report.certificate.certificate import Certificate, largest_beside
from uq.report.tables.identification import largest_not_included, not_included_tables

SHORT = {"seconds": 15.0}
UNIT = np.eye(6)


def added(result):
    """What each adds to the ten parameters, by name."""
    return {effect.name: effect.parameters for effect in result.not_included.effects}


def ten(result):
    return np.concatenate([[result.mass], result.r_cg, result.inertia])


def looked_at(measured, method):
    """The result of arrays with what it does not include."""
    experiment = Experiment.from_dict(document(measured, method))
    return with_not_included(identified(measured, method), [run_of(measured)], experiment)


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
    "force_gain": lambda _: [{"cell_gain": tuple(0.005 * unit)} for unit in UNIT[:3]],
    "moment_gain": lambda _: [{"cell_gain": tuple(0.005 * unit)} for unit in UNIT[3:]],
    "cross_talk": lambda measured: talk(measured, 0.005),
    "load_cell_axes": lambda _: axes("cell_turn", 0.005),
    "gyro_scale": lambda _: axes("gyro_scale", 0.005),
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


def test_generalised_least_squares_is_off_as_the_table_says(measured, monkeypatch):
    """Its weights are learnt anew from the spoiled recording: 7 % of the largest."""
    result = looked_at(measured, "gls")
    monkeypatch.setattr(identification, "judged", lambda result, problem: result)
    clean = identified(measured, "gls").inertia
    shifts = [
        identified(replace(measured, omega=measured.omega * (1 + 0.005 * unit)), "gls").inertia - clean
        for unit in np.eye(3)
    ]
    off = np.linalg.norm(shifts, axis=0)
    np.testing.assert_allclose(added(result)["gyro_scale"][4:], off, atol=0.07 * off.max())


@pytest.fixture(scope="module")
def still():
    return measure(1, still=True, **SHORT)


@pytest.fixture(scope="module")
def jointly(still):
    return looked_at(still, "joint")


def test_the_joint_estimate_is_off_as_the_table_says(still, jointly, monkeypatch):
    """With its centre of gravity: within 4 % of the largest where the error is small, a tenth of the gyro's, and 200 Hz.

    Larger ones make it trust the spoiled rows less, by weights learnt anew.
    """
    monkeypatch.setattr(identification, "judged", lambda result, problem: result)
    scale = 5e-4 * np.array([1.0, -1.0, 1.0])
    by_scale = jointly.by_held_errors["gyro_scale"]
    np.testing.assert_allclose(added(jointly)["gyro_scale"], 0.005 * np.linalg.norm(by_scale, axis=1))
    stiff = added(jointly)["mounting_frequency"] / 16
    for options, expected in (({"gyro_scale": tuple(scale)}, by_scale @ scale), ({"flex_frequency": 200.0}, stiff)):
        off = ten(identified(measure(1, still.setup, **options), "joint")) - ten(jointly)
        for rows in (slice(1, 4), slice(4, 10)):
            atol = max(0.04 * np.abs(expected[rows]).max(), 5e-7)
            np.testing.assert_allclose(off[rows], expected[rows], atol=atol)


def test_an_unknown_is_not_there(by_source, jointly):
    """By least squares gravity does nothing; of the joint estimate delay and the gyro's axes are unknowns."""
    assert by_source.warnings == ()
    assert set(added(by_source)) == set(TROUBLES)
    assert set(added(jointly)) == {*TROUBLES, "gravity"} - {"delay", "gyro_axes"}


def again(result, measured, without=(), sources=(), **own):
    """What is not included with these sources, without others, and with an experiment's own figures."""
    content = document(measured, sources=sources) | {"not_included": own}
    content["source"] = [table for table in content["source"] if table["name"] not in without]
    return added(with_not_included(result, [run_of(measured)], Experiment.from_dict(content)))


def test_what_is_declared_is_not_there(by_source, measured):
    declared = [source("g", "omega", "scale", [0.3] * 3), source("c", "wrench", "cross_talk", 5e-3)]
    assert set(again(by_source, measured, sources=declared)) == set(TROUBLES) - {"gyro_scale", "cross_talk"}


def test_the_experiment_has_its_own_figures(by_source, measured):
    """Half the gain is half the effect, twice the frequency a quarter, false is none; an exact r_CG has its price."""
    usual = again(by_source, measured)
    names = ("cross_talk", "moment_gain", "load_cell_axes", "gyro_scale", "gyro_axes", "delay")
    own = {"force_gain": "0.25 %", "mounting_frequency": "100 Hz"} | dict.fromkeys(names, False)
    exact = replace(by_source, sigma_r_cg=np.zeros(3))
    ours = again(exact, measured, without=("r_cg",), **own)
    assert set(ours) == {"force_gain", "mounting_frequency", "centre_of_gravity"}
    np.testing.assert_allclose(ours["force_gain"], usual["force_gain"] / 2, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(ours["mounting_frequency"], usual["mounting_frequency"] / 4, rtol=1e-12)
    by_axis = [least_squares(replace(measured, r_cg=measured.r_cg + 1e-3 * unit)) for unit in np.eye(3)]
    off = np.linalg.norm(np.array(by_axis) - least_squares(measured), axis=0)
    np.testing.assert_allclose(ours["centre_of_gravity"][4:], off, atol=0.03 * off.max())


def test_where_all_is_declared_nothing_is_left_out(by_source, measured):
    """But gravity, to which least squares are blind: nothing is left to be computed."""
    names = {"gyro_axes": ("omega", "misalignment"), "load_cell_axes": ("wrench", "misalignment"), "gyro_scale": ("omega", "scale"),
             "force_gain": ("F", "scale"), "moment_gain": ("M", "scale")}  # fmt: skip
    declared = [source(name, *pair, [0.3] * 3) for name, pair in names.items()]
    declared += [source("talk", "wrench", "cross_talk", 5e-3), source("late", "omega", "delay", 1e-3)]
    content = document(measured, sources=declared) | {"not_included": {"mounting_frequency": False}}
    result = with_not_included(by_source, [run_of(measured)], Experiment.from_dict(content))
    assert result.not_included.effects == ()
    assert not_included_tables(result) == []
    assert not any(note.startswith("not included") for note in result.notes())


def test_all_ten_together_are_a_root_sum_of_squares_and_the_mass_counts():
    one, other = (Effect(name, name, "1", 1e-3 * np.array(values), signed) for name, values, signed in
                  (("a", [3.0, 0, 0, 0, 3, 0, 0, 0, 0, 0], False), ("b", [-4.0, 0, 0, 0, 4, 0, 0, 0, 0, 0], True)))  # fmt: skip
    both, u = NotIncluded((one, other)), 1e-3 * np.array([1.0, 1, 1, 1, 50, 1, 1, 1, 1, 1])
    np.testing.assert_allclose(both.together, 1e-3 * np.array([5.0, 0, 0, 0, 5, 0, 0, 0, 0, 0]))
    assert both.share(u) == (pytest.approx(5.0), 0)
    assert largest_beside(both, u) == "5.0 g in the mass beside u = 1.0"
    u[0] = np.nan
    assert both.share(u) == (pytest.approx(0.1), 4)
    assert NotIncluded(()).share(u)[0] == 0


def test_it_is_said_in_a_line_in_result_json_and_on_the_certificate(by_source):
    (line,) = (note for note in by_source.notes() if note.startswith("not included"))
    assert "more than the half-width of its interval" in line
    rows = json.loads(json.dumps(by_source.to_dict()))["not_included"]
    assert {row["name"]: row["inertia"]["I33"] for row in rows}["moment_gain"] == pytest.approx(1.92e-3, rel=0.01)
    (table,) = (table for table in Certificate(by_source).details() if table.caption.startswith("Not included"))
    assert [row[0] for row in table.rows][:2] == ["gain of the force", "gain of the moment"]
    assert table.caption in [each.caption for each in by_source.tables()]


@pytest.mark.parametrize(
    ("half", "said"),
    [(9.0, "to I33; see"), (1.5, "to I33, more than half the half-width of its interval, 1.5 g·m²; see"),
     (0.5, "to I33, more than the half-width of its interval, 0.50 g·m²; see")],
)  # fmt: skip
def test_the_line_names_the_largest_against_its_interval(half, said):
    """Not the largest figure: I11 moves more, in a wider interval."""
    parameters = 1e-3 * np.array([0, 0, 0, 0, 2.0, 0, 0, 0, 0, 1.0])
    interval = 1e-3 * half * np.array([10.0, 9, 9, 9, 9, 1])[:, None] * [-1, 1]
    effects = (Effect("moment_gain", "gain of the moment", "0.5 %", parameters, False),)
    line = largest_not_included(NotIncluded(effects), interval, np.zeros(4))
    assert line.startswith("not included: gain of the moment, at a typical 0.5 %, which would add 1.0 g·m² ")
    assert said in line


def test_the_line_names_a_mass_that_is_estimated():
    """Six grams are little beside the tensor's, and twelve times the half-width of the mass's own interval."""
    effects = (Effect("force_gain", "gain of the force", "0.5 %", 1e-3 * np.array([6.0] + [0] * 3 + [1.0] * 6), False),)
    interval = 1e-3 * np.full((6, 1), 0.2) * [-1, 1]
    line = largest_not_included(NotIncluded(effects), interval, np.array([0.5e-3, 1e-5, 1e-5, 1e-5]))
    assert "6.0 g to the mass, more than the half-width of its interval, 0.50 g; see" in line
    assert "to I11" in largest_not_included(
        NotIncluded(effects), interval, np.zeros(4)
    )  # a mass that is declared is none of the estimate's
