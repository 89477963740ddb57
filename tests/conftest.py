"""Settings of the tests: float64 on, two devices, nothing promoted in silence; a short experiment."""

import ctypes
import dataclasses
import gc
import os
import shutil
import tempfile
from functools import partial
from pathlib import Path

import jax
import numpy as np
import pytest
from hypothesis import settings

from tests.helpers import sparing_checks  # before anything that it checks
from uq.files.compilation_cache import keep_compiled

gc.set_threshold(50_000, 20, 20)  # JAX makes the collector slow, and what is imported is no garbage
if jax.__version_info__ >= (0, 11, 1):  # which ends where it is given an option that it no longer has
    os.environ["XLA_FLAGS"] = os.environ.get("XLA_FLAGS", "").replace("--xla_cpu_use_fusion_emitters=false", "")
if "PYTEST_XDIST_WORKER" not in os.environ:  # whoever starts the others: what one compiles, none compiles again
    os.environ["INERTIA_CACHE"] = os.environ.get("INERTIA_TEST_CACHE") or tempfile.mkdtemp(prefix="inertia-tests-")
keep_compiled()
os.environ.pop("COLUMNS", None)  # xdist gives its workers 80: tables would wrap
jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")
jax.config.update("jax_num_cpu_devices", 2)


def pytest_collection_finish():
    """What was imported lives until the end: the collector of garbage need not look at it again."""
    gc.freeze()


PLACES = {"notebooks": 0, "rig": 1, "uq": 2, "identify": 4}


def pytest_collection_modifyitems(items):
    """The longest file first; what waits for clocks while make's checks run; short files last, so that workers end together."""

    def place(item):
        return next((PLACES[part] for part in item.nodeid.split("/") if part in PLACES), 3)

    items.sort(key=place)


def pytest_runtest_setup():
    sparing_checks.begin_test()


def pytest_unconfigure():
    if "PYTEST_XDIST_WORKER" not in os.environ and "INERTIA_TEST_CACHE" not in os.environ:
        shutil.rmtree(os.environ["INERTIA_CACHE"], ignore_errors=True)


settings.register_profile("same", derandomize=True)  # the same examples in every run
settings.load_profile("same")


@pytest.fixture(autouse=True, scope="module")
def room():
    """What a worker has compiled is dropped once it holds 6 GiB or a quarter of the machine: the cache folder has it still.

    The system gets that memory back only where glibc is asked; else it would be dropped after every file from then on.
    """
    yield
    status = Path("/proc/self/statm")
    if not status.exists():
        return
    page, pages = os.sysconf("SC_PAGE_SIZE"), os.sysconf("SC_PHYS_PAGES")
    if int(status.read_text().split()[1]) > min(6 * 2**30 // page, pages // 4):
        jax.clear_caches()
        if hasattr(libc := ctypes.CDLL(None), "malloc_trim"):
            libc.malloc_trim(0)


@pytest.fixture(autouse=True, scope="session")
def rendered_once():
    """Of figures of one size and the same labels the first is rendered, and its picture stands for the others.

    Each is drawn, with its own data; what takes long is to lay it out and to write it.
    """
    from uq.report import page, report_files

    pictures, real = {}, page.rendered

    def rendered(figure, kind):
        labels = [(axes.get_title(), axes.get_xlabel(), axes.get_ylabel()) for axes in figure.axes]
        kind_of_figure = (kind, *figure.get_size_inches(), *labels)
        if kind_of_figure not in pictures:
            pictures[kind_of_figure] = real(figure, kind)
        return pictures[kind_of_figure]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(page, "rendered", rendered)
        patch.setattr(report_files, "rendered", rendered)
        yield real


@pytest.fixture(scope="module")
def every_picture(rendered_once):
    """Each figure is rendered itself from here to the end of the file, for what is said of pages' sizes."""
    with pytest.MonkeyPatch.context() as patch:
        for module in ("page", "report_files"):
            patch.setattr(f"uq.report.{module}.rendered", rendered_once)
        yield


@pytest.fixture(autouse=True, scope="session")
def result_files_follow_their_schema():
    """Every file that a test writes of a result is held against uq/schemas/result.json."""
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


@pytest.fixture(autouse=True, scope="session")
def one_device():
    """Trials run on one device where a test names none: the two that they could share take longer to compile."""
    with pytest.MonkeyPatch.context() as patch:
        for module in ("trials.trial_loop", "campaign.campaign", "sensitivity.source_budget"):
            patch.setattr(f"uq.{module}.default_devices", lambda: jax.devices()[:1])
        yield


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
    from uq.identification.systematic_errors import with_declared_sources

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            "uq.identification.identify_files.with_declared_sources", partial(with_declared_sources, trials=500)
        )
        yield


@pytest.fixture
def unjudged(monkeypatch):
    """Estimates without the check of the model, most of their time: for repeats of clean runs, where intervals are tested."""
    monkeypatch.setattr("identify.identification.judged", lambda result, problem: result)
