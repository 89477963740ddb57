"""A periodic motion's unknowns come back."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from identify.motion.leg_limits import Limits
from identify.motion.periodic_motion import Periodic
from uq.experiment.platform_table import PlatformTable
from uq.files.schema import declared_table


@pytest.fixture(scope="module")
def platform():
    return jax.tree.map(
        jnp.asarray, declared_table("platform", {"geometry": "assumed-source-size"}, PlatformTable).legs
    )


@pytest.fixture(scope="module")
def periodic(platform):
    limits = Limits.none()._replace(acceleration=np.full(6, 1.2), speed=np.full(6, 0.128))
    return Periodic.of(platform, limits, period=2.0, band=2.0, rate=80.0)


def test_unknowns_come_back(periodic, generator):
    unknowns = generator.normal(size=periodic.unknowns)
    amplitudes = np.asarray(periodic.amplitudes(jnp.asarray(unknowns)))
    np.testing.assert_allclose(periodic.unknowns_of(amplitudes), unknowns, atol=1e-12)
