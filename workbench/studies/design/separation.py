"""How far apart rivals stay when each has done its best: criteria of experiments."""

from collections.abc import Sequence

import numpy as np
from scipy.stats import ncx2

from workbench.arrays import Matrix, Vector
from workbench.diagnosis.inference.quadratic import Quadratic, add, covariance, minimum
from workbench.diagnosis.inference.thresholds import Thresholds


def refitted(new: Quadratic, information: Matrix) -> tuple[float, Vector]:
    """Chi-squared that a rival leaves where another model is true, when all is fitted again.

    Parameters
    ----------
    new : chi-squared of the new recording over the rival's unknowns, with the difference of both
        responses as errors and without noise; what belongs to that recording alone is eliminated.
    information : (p, p) of the rival's unknowns in the recordings so far.

    Returns
    -------
    left : chi-squared.
    z : (p,) by what the rival's unknowns change.

    Notes
    -----
    W. G. Hunter, A. M. Reiner (1965), Technometrics 7, 307-323, maximise the squared difference
    d'd of the responses of two models. Here the rival is fitted again, as by A. C. Atkinson,
    V. V. Fedorov (1975), Biometrika 62, 57-70 (T-optimality), and its unknowns are held by what is
    known of them. In white noise of variance 1, the least of |d + J z|^2 + z' N z over the steps z
    of its unknowns is d' (I + J N^-1 J')^-1 d: the criterion of G. Buzzi-Ferraris, P. Forzatti
    (1983), Chem. Eng. Sci. 38, 225-232, with the covariance of noise and of the rival's prediction;
    the true model is assumed, so that its own is none.

    Examples
    --------
    A rival that differs by 3 everywhere and has nothing to fit, in four samples:

    >>> rival = Quadratic(np.zeros((0, 0)), np.zeros(0), 4 * 3.0**2, 4)
    >>> refitted(rival, np.zeros((0, 0)))[0]
    36.0
    """
    total = add([new, Quadratic(information, np.zeros(len(information)), 0.0, 0)])
    z = minimum(total)
    return total.at(z), z


def discrimination_chance(chi_squared: float, explained: float, decides: Thresholds) -> float:
    """Probability that a diagnosis tells a rival from the true cause.

    It says that they cannot be told apart while the rival leaves less chi-squared beyond the best
    than laws may owe to their form. What the true cause takes away, put beside the rival, follows a
    non-central chi-squared of one degree of freedom, with `chi_squared` as non-centrality.

    Parameters
    ----------
    chi_squared : see `refitted`; of all recordings.
    explained : chi-squared that the true cause explains in all recordings.
    """
    form = max(decides.form, decides.form_share * explained)
    return float(ncx2.sf(form, 1, max(chi_squared, 0.0)))


def precision(new: Matrix, information: Matrix, at: Sequence[int]) -> tuple[float, float]:
    """How sure some unknowns are, before and after a new recording.

    Parameters
    ----------
    new, information : (p, p) of all unknowns in the new recording, and in those so far.
    at : of the p unknowns.

    Returns
    -------
    before, after : geometric mean of the standard deviations along the axes of their ellipsoid;
        Ds-optimality makes it least, whatever their units. Of one unknown it is its standard
        deviation. Source: A. C. Atkinson, A. N. Donev, R. D. Tobias (2007), Optimum Experimental
        Designs, with SAS, section 10.3.
    """
    before, after = (
        float(np.exp(0.5 * np.linalg.slogdet(covariance(known)[np.ix_(at, at)])[1] / len(at)))
        for known in (information, information + new)
    )
    return before, after
