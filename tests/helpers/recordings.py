"""Simulated runs written to files in whatever way a rig might record them."""

import json
from dataclasses import dataclass, replace

import numpy as np

from rig import runs
from rig.channels import ImuChannel, WrenchChannel

START = 1_700_000_000_000_000_000


@dataclass
class Signals:
    """Force and moment on the body at Q, angular velocity and specific force at Q, all in B, at common instants."""

    t: np.ndarray
    force: np.ndarray
    moment: np.ndarray
    omega: np.ndarray
    specific_force: np.ndarray

    @classmethod
    def of(cls, simulated):
        run = simulated.run
        return cls(run.t, run.force, run.moment, run.omega, simulated.specific_force)


def silenced(experiment, *targets):
    """The experiment with errors of size zero, of all or of these targets: the same sources, so that nothing is compiled anew."""
    sources = [replace(s, sigma=0 * s.sigma) if not targets or s.target in targets else s for s in experiment.sources]
    return replace(experiment, sources=tuple(sources))


def write(path, signals, *, metadata=None, every=1, stamped=True, late=None, sequence=None):
    """Write a run; the IMU has every n-th sample, the wrench's log times come ``late`` [s], its headers may be bare."""
    stamp = START + np.round(signals.t * 1e9).astype(np.int64)
    log = stamp if late is None else np.sort(stamp + np.round(late * 1e9).astype(np.int64))
    head = stamp if stamped else np.zeros_like(stamp)
    wrench = WrenchChannel("/wrench", "cell", log, head, signals.force, signals.moment, sequence)
    slow = slice(None, None, every)
    imu = ImuChannel("/imu", "imu", stamp[slow], stamp[slow], signals.omega[slow], signals.specific_force[slow])
    runs.write(path, wrench=wrench, imu=imu, metadata={} if metadata is None else {"rig.run": metadata}, overwrite=True)
    return path


def about(**facts):
    """Metadata of a run, tables as JSON."""
    return {key: value if isinstance(value, str) else json.dumps(value) for key, value in facts.items()}


def declare(experiment, *, estimator="smoothed", sources=None, **recording):
    """The experiment with these keys in ``[recording]``, as a file would have them."""
    document = dict(experiment.document) | {"recording": {"estimator": estimator} | recording}
    fresh = type(experiment).from_dict(document)
    kept = experiment.sources if sources is None else sources
    return replace(fresh, sources=kept, trajectories=experiment.trajectories)
