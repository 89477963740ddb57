"""What moves and what rests in a simulated recording, and which motion counts."""

import numpy as np
import pytest

from identify.signals.segments import decisive, moving, still
from tests.helpers.scene import MOUNTED, POSES, TURN, record
from uq.monte_carlo.campaign.simulation import simulate

RATE = 400.0


@pytest.fixture(scope="module", params=[(0, 1.0), (1, 0.0), (2, 5.0)], ids=["noise", "silent", "noise x 5"])
def scene(request, short):
    seed, noise = request.param
    return record(short, np.random.default_rng(seed), noise=noise)


def test_every_motion_of_a_recording_is_found(scene):
    segments = moving(RATE, scene.omega)
    assert len(segments) == 8  # mounting, three turns, two broken starts, the trajectory, a knock
    assert segments[0].stop == pytest.approx(MOUNTED, abs=0.5)
    for turn, (begin, _) in zip(segments[1:4], POSES, strict=True):
        assert begin - 0.1 < turn.start < begin + 1
        assert begin + TURN - 1 < turn.stop < begin + TURN + 0.5
    assert scene.start < segments[6].start < scene.start + 1.2  # its ramp starts from nothing
    assert scene.stop - 1.2 < segments[6].stop < scene.stop
    assert segments[7].seconds < 1


def test_rest_is_where_nothing_moves_and_nobody_touches(scene):
    segments = still(RATE, scene.omega, scene.force, scene.moment)
    assert len(segments) >= 5
    motions = [(2.2, MOUNTED - 0.2), *((begin + 0.6, begin + TURN - 0.6) for begin, _ in POSES)]
    motions += [(scene.start + 1.2, scene.stop - 1.2), (scene.stop + 3, scene.stop + 3.2)]
    for segment in segments:
        assert segment.seconds >= 1
        assert all(segment.stop < begin or segment.start > end for begin, end in motions)


def test_hands_that_touch_a_body_at_rest_are_no_rest(short, generator):
    scene = record(short, generator)
    held = (scene.t > 34.5) & (scene.t < 36.5)
    scene.force[held] += 15 * np.sin(2 * np.pi * 1.3 * scene.t[held])[:, None]
    segments = still(RATE, scene.omega, scene.force, scene.moment)
    assert all(segment.stop < 34.6 or segment.start > 36.4 for segment in segments)
    assert any(segment.start > 33 and segment.stop < 34.6 for segment in segments)


def test_of_all_motions_the_trajectory_counts(scene):
    segments = moving(RATE, scene.omega)
    assert decisive(RATE, scene.omega, scene.force, scene.moment, segments) == (segments[6],)


def test_hands_that_turn_the_body_longer_and_faster_than_the_trajectory_do_not_count(short, generator):
    """40 s of hands at three times the trajectory's speed, and a force that no rigid body explains."""
    scene = record(short, generator)
    hands = np.arange(0, 40, 1 / RATE)
    turns = np.sin(2 * np.pi * np.multiply.outer(hands, [0.9, 0.7, 1.1]))
    grip = np.cumsum(generator.standard_normal((len(hands), 3)), axis=0)
    grip -= np.linspace(grip[0], grip[-1], len(hands))
    omega, force = np.vstack([1.2 * turns, scene.omega]), np.vstack([0.2 * grip, scene.force])
    moment = np.vstack([0.02 * grip[:, ::-1], scene.moment])
    segments = moving(RATE, omega)
    chosen = decisive(RATE, omega, force, moment, segments)
    assert len(chosen) == 1
    assert chosen[0].start == pytest.approx(40 + scene.start, abs=1.2)


@pytest.mark.parametrize("name", ["T3", "T4"])
def test_motions_about_one_axis_each_stay_together(short, name):
    """Pauses of 2 s between; the axis of the least inertia gives a moment below the noise."""
    run = simulate(short, name).run
    third, rest = len(run.t) // 3, np.tile([0], 800)
    index = np.concatenate([np.r_[k * third : (k + 1) * third, rest + k * third] for k in range(3)])
    omega, force, moment = run.omega[index], run.force[index], run.moment[index]
    segments = moving(RATE, omega)
    assert len(segments) == 3
    assert decisive(RATE, omega, force, moment, segments) == segments


def test_a_trajectory_run_five_times_counts_five_times(short):
    run = simulate(short, "T1").run
    omega, force, moment = (np.tile(s, (5, 1)) for s in (run.omega, run.force, run.moment))
    segments = moving(RATE, omega)
    assert len(segments) == 5
    assert decisive(RATE, omega, force, moment, segments) == segments


def test_units_of_rate_do_not_matter(short):
    """The same scene at a quarter of the rate has the same segments."""
    scene = record(short, np.random.default_rng(3))
    fine = moving(RATE, scene.omega)
    coarse = moving(RATE / 4, scene.omega[::4])
    np.testing.assert_allclose(fine, coarse, atol=0.2)
