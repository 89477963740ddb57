"""Settings of the tests: float64 on, two devices, nothing promoted in silence; a short experiment."""

import ctypes
import dataclasses
import gc
import os
import shutil
import tempfile
from functools import partial

import jax
import numpy as np
import pytest
from hypothesis import settings

from tests.helpers import checked_calls  # before what it checks is imported
from tests.helpers.driven_browser import WANTING
from uq.files.compilation_cache import keep_compiled

if "PYTEST_XDIST_WORKER" not in os.environ:  # whoever starts the others: what one compiles, none compiles again
    os.environ["INERTIA_CACHE"] = os.environ.get("INERTIA_TEST_CACHE") or tempfile.mkdtemp(prefix="inertia-tests-")
keep_compiled()
os.environ.pop("COLUMNS", None)  # xdist gives its workers 80: tables would wrap
jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")
jax.config.update("jax_num_cpu_devices", 2)


PLACES = {"notebooks": 0, "rig": 1, "uq": 2, "identify": 4}


def pytest_collection_modifyitems(items):
    """The longest file first; what waits for clocks while make's checks run; short files last, so that workers end together."""

    def place(item):
        return next((PLACES[part] for part in item.nodeid.split("/") if part in PLACES), 3)

    items.sort(key=place)


def pytest_unconfigure():
    if "PYTEST_XDIST_WORKER" not in os.environ and "INERTIA_TEST_CACHE" not in os.environ:
        shutil.rmtree(os.environ["INERTIA_CACHE"], ignore_errors=True)


def used():
    """User time [s] of this process and of those it has waited for, and the largest memory of either so far [MB]."""
    import resource  # which not every system has

    usage = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime for each in usage), *(each.ru_maxrss / 1e3 for each in usage)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item):
    """Append a line for each test to the file that INERTIA_TEST_USAGE names: user time, memory so far, worker, test."""
    checked_calls.Checks.test += 1
    if (usage := os.environ.get("INERTIA_TEST_USAGE")) is None:
        return (yield)
    before, *_ = used()
    result = yield
    after, mine, theirs = used()
    line = f"{after - before:.2f}", f"{mine:.0f}", f"{theirs:.0f}", os.environ.get("PYTEST_XDIST_WORKER", "-")
    with open(usage, "a") as file:
        print(*line, item.nodeid, sep="\t", file=file)
    return result


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_sessionfinish(session):
    """The last line of a run counts what it skipped for want of a browser, and says how to get it."""
    result = yield
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    skipped = [
        report.longrepr[2].removeprefix("Skipped: ")
        for report in (reporter.stats if reporter else {}).get("skipped", ())
    ]
    wanting = [reason for reason in skipped if reason in WANTING]
    if wanting:
        cures = "; ".join(sorted(set(wanting)))
        reporter.write_line(f"{len(wanting)} tests of pages were skipped for want of a browser ({cures})", yellow=True)
    return result


settings.register_profile("same", derandomize=True)  # the same examples in every run
settings.load_profile("same")


LARGEST = 1200
"""MB of memory from which a worker forgets what it has compiled; before, the next file may use it again."""


def resident():
    """Memory [MB] that this process has now; where no system says it, more than it may have."""
    try:
        with open("/proc/self/statm") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
    except OSError:
        return np.inf


def return_freed():
    """Return to the system what is free: glibc keeps what a compilation took, which adds up to gigabytes."""
    if hasattr(library := ctypes.CDLL(None), "malloc_trim"):
        library.malloc_trim(0)


def pytest_collection_finish():
    """What is imported stays: whoever looks for garbage need not look at it, and, with traces of millions of objects, seldom."""
    gc.freeze()
    gc.set_threshold(50_000, 20, 20)


@pytest.fixture(scope="module", autouse=True)
def memory_is_returned():
    """After each file of tests: all files together would fill a worker's memory."""
    yield
    return_freed()
    if resident() > LARGEST:
        jax.clear_caches()
        gc.collect()
        return_freed()


@pytest.fixture(scope="module")
def results_follow_their_schema():
    """Every file that a test of this module writes of a result is held against uq/schemas/result.json."""
    from tests.helpers.result_schema import contradictions
    from uq.report import report_files

    real = report_files.json_text

    def json_text(content):
        text = real(content)
        assert "kind" not in content or (wrong := contradictions(text)) == [], wrong
        return text

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(report_files, "json_text", json_text)
        yield


@pytest.fixture
def blank_pictures(monkeypatch):
    """Figures are drawn, but neither laid out nor rendered: for tests of a page's words."""
    blank = b'<svg xmlns="http://www.w3.org/2000/svg" width="9pt" height="9pt"><path d="M 0 0 L 9 9"/></svg>'
    monkeypatch.setattr("uq.report.page.laid_out", lambda figure: figure)
    for module in ("page", "report_files"):
        monkeypatch.setattr(f"uq.report.{module}.rendered", lambda figure, kind: blank)


@pytest.fixture
def generator():
    return np.random.default_rng(20161)


@pytest.fixture(scope="session")
def preset():
    from uq.experiment.experiment import Experiment

    return Experiment.load("barreto2016")


@pytest.fixture(scope="session")
def short(preset):
    """The preset with trajectories of 7,900 samples: some blocks, the last not full."""
    return lasting(preset, 19.75)


@pytest.fixture(scope="session")
def brief(preset):
    """The preset with trajectories of 3,100 samples: three blocks, the last not full. For many trials."""
    return lasting(preset, 7.75)


def lasting(experiment, seconds):
    """The experiment with trajectories of so many seconds."""

    def shorter(spec):
        ramp = np.array(seconds / spec.duration * spec.trajectory.ramp)
        trajectory = dataclasses.replace(spec.trajectory, duration=np.array(seconds), ramp=ramp)
        return dataclasses.replace(spec, duration=seconds, trajectory=trajectory)

    trajectories = {name: shorter(spec) for name, spec in experiment.trajectories.items()}
    return dataclasses.replace(experiment, trajectories=trajectories)


@pytest.fixture(scope="module")
def few_draws():
    """Recorded runs' declared sources by 500 draws, not 10,000: where their statistics are not what is tested."""
    from uq.runs.identification.systematic_errors import with_declared_sources

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            "uq.runs.identification.identify_files.with_declared_sources", partial(with_declared_sources, trials=500)
        )
        yield


@pytest.fixture(scope="module")
def undrawn():
    """Recorded runs without draws of their declared sources, which JAX compiles anew for each list of sources."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("uq.runs.identification.identify_files.with_declared_sources", lambda result, *_, **__: result)
        yield


@pytest.fixture
def unjudged(monkeypatch):
    """Estimates without the check of the model, most of their time: for repeats of clean runs, where intervals are tested."""
    from tests.helpers.changed_result import not_judged

    monkeypatch.setattr("identify.identification.judged", not_judged)
