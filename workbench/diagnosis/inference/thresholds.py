"""What decides in a diagnosis: thresholds, from one rate of false alarms where theory gives them.

Where none does, because laws of a model and of a machine differ in form, a number stands with its
reason; `workbench power --thresholds` shows what half and twice of each change.
"""

import math
from dataclasses import dataclass

from scipy.special import chdtri, ndtr, ndtri

from workbench.system.comparison import RATE, Comparison


@dataclass(frozen=True)
class Soundness:
    """Which samples are taken for wrong, and what moves, in standard deviations of their noise.

    Attributes
    ----------
    spike : off the running median: no noise reaches it. By theory 5.8 in the 240 000 samples of six
        stops; but noise may grow with a signal, and structures ring.
    stuck : equal samples in a row: a channel that is noisy does not repeat itself.
    held : a polynomial that takes away more is no smoothing: chance makes 3.8 in a stop's samples.
    """

    spike: float = 8.0
    stuck: int = 6
    held: float = 4.0


SOUND = Soundness()


@dataclass(frozen=True)
class Thresholds:
    """What decides in a diagnosis.

    Attributes
    ----------
    significant : standard deviations of a size; the largest of all candidates' by chance.
    fall : of chi-squared; likewise, its square.
    immaterial : standard deviations from zero to a size that matters, of a second effect too small
        to; of one effect alone, what is significant.
    tied : chi-squared by which fits are equals, or held-out recordings are foretold no better: odds
        that chance turns at the rate.
    wrong : variance of errors that last, over noise, from which on much is wrong. Chance makes 1.5
        of a hundred means, and 4.3 of five; laws that differ a little in form may make as much.
    form : chi-squared that a candidate may owe to its form, since laws are simplified.
    form_share : the same, as a share of what the effect explains: laws agree to some 3 %, squared.
    twin : one less cosine of signatures within which an effect is fitted in full.
        The scatter of a candidate is then 5 times that alone; it costs time only.
    near : share of the best score from which on an effect is a candidate: scores are linear, and
        laws bend.
    behind : times the chi-squared of the best from which on a fit that has begun is not finished.
    idle : share of the explainable below which an effect beside others is no cause, but bends to
        what their forms leave.
    left : share of systematic errors that a right effect leaves by its form; wrong ones leave more.
    excess : of the mean square of white errors over 1, which an estimate of noise may leave: a
        tenth of the deviation is a fifth of it, and block means keep some ringing.
    worse : of deviance, which no step of a fit is worth: a thirtieth of what is significant.
    furthest : standard deviations that no tolerance goes beyond; chance makes 4 of thirty.
    furthest_level : the same of levels, which differ by more; beyond 3 a friction may
        be none.
    most : causes; more than that is not a diagnosis.
    rivals : effects that are fitted in full before one is named; it costs time only.
    samples : which samples count.
    """

    significant: float
    fall: float
    immaterial: float
    tied: float
    wrong: float = 6.0
    form: float = 40.0
    form_share: float = 0.001
    twin: float = 0.02
    near: float = 0.4
    behind: float = 3.0
    idle: float = 0.05
    left: float = 0.03
    excess: float = 0.3
    worse: float = 0.5
    furthest: float = 5.0
    furthest_level: float = 3.0
    most: int = 4
    rivals: int = 5
    samples: Soundness = SOUND

    @property
    def hint(self) -> float:
        """Standard deviations of a size while much is wrong, all being weighed against that."""
        return 0.5 * self.significant

    def fall_of(self, unknowns: int) -> float:
        """Fall of chi-squared that chance makes of so many unknowns as seldom as `fall` of one.

        >>> decides = thresholds(28)
        >>> round(decides.fall_of(1), 1), round(decides.fall_of(7), 1)
        (15.8, 30.7)
        """
        return float(chdtri(unknowns, 2.0 * ndtr(-self.significant)))

    def chance(self, unknowns: int) -> float:
        """Chi-squared of so many unknowns that chance exceeds at the rate of false alarms.

        >>> decides = thresholds(28)
        >>> round(decides.chance(2), 1), round(decides.tied, 1)
        (12.4, 12.4)
        """
        return float(chdtri(unknowns, 2.0 * ndtr(-self.immaterial)))

    @property
    def needed(self) -> float:
        """Fall of chi-squared by an effect beside others: significant beyond what forms fake."""
        return self.form + self.fall


def thresholds(candidates: int, rate: float = RATE, left: float = Thresholds.left) -> Thresholds:
    """Thresholds by which at most a share of clean sets is called something else.

    Parameters
    ----------
    candidates : effects that are tried; any of them may raise an alarm (Bonferroni).
    rate : of false alarms, between 0 and 1; a system says which it allows.
    left : see `Thresholds`; a system says what its models simplify.

    Notes
    -----
    A size is normal about zero. Fitted, its square is by what chi-squared falls, of one degree of
    freedom (S. S. Wilks, 1938, Ann. Math. Stat. 9, 60-62).
    An immaterial second effect exceeds what matters at the rate. Of two fits with as many unknowns,
    a difference D of chi-squared stands for odds of exp(D/2).

    >>> usual = thresholds(28)
    >>> round(usual.significant, 2), round(usual.fall, 1), round(usual.tied, 1)
    (3.97, 15.8, 12.4)
    """
    size = float(-ndtri(0.5 * rate / candidates))
    return Thresholds(
        significant=size,
        fall=size**2,
        immaterial=float(-ndtri(0.5 * rate)),
        tied=-2.0 * math.log(rate),
        left=left,
    )


def of_system(comparison: Comparison, candidates: int) -> Thresholds:
    """Thresholds by the rate that a system allows, and by what its models simplify."""
    return thresholds(candidates, comparison.false_alarms, comparison.left)
