"""How sure sizes are where errors go on in time, against closed forms."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from workbench.diagnosis.inference.discrepancy import autocovariance, share_by_form


def test_autocovariance_is_that_of_a_process_of_first_order():
    """Reference: a^k/(1 - a^2) at lag k. Of 1e5 samples it is known to some 2 %."""
    rng, a = np.random.default_rng(3), 0.8
    errors = [np.zeros(2000) for _ in range(50)]
    for own in errors:
        for k, noise in enumerate(rng.standard_normal(own.size - 1), start=1):
            own[k] = a * own[k - 1] + noise
    found = autocovariance(errors)
    assert_allclose(found[:5], a ** np.arange(5) / (1.0 - a**2), rtol=0.06)


def test_a_size_is_as_unsure_as_what_remains_of_its_effect():
    """Student's t of two degrees of freedom: 4.303, over 1.96 of the band."""
    assert share_by_form(4.0, 400.0) == pytest.approx(0.1 * 4.303 / 1.96, rel=1e-3)
    assert share_by_form(-0.1, 400.0) == 0.0
