"""Results of a tuning as they are written: gains.toml and summary.json."""

from dataclasses import asdict
from typing import Any

import numpy as np

from workbench.fmu import Matrix, Vector
from workbench.observers import estimators
from workbench.observers.gains_file import format_gains
from workbench.tuning.recipe import Tuned
from workbench.tuning.validation import NEGLIGIBLE


def tuned_gains(tuned: Tuned) -> str:
    """The text of gains.toml, with what the gains come from."""
    job, found = tuned.problem.job, tuned.search
    at_bound = tuned.problem.space.at_bound(found.coordinates)
    came_from = {
        **_provenance(tuned),
        "z": found.z,
        "z_k": _by_case(tuned, found.z_k),
        "generations": len(found.history) - 1,
        "interrupted": found.interrupted,
        "at_bound": [n for n, at in zip(job.gains.names, at_bound, strict=True) if at],
    }
    meaning = estimators(job.system)[job.estimator].meaning
    return format_gains(job.gains.with_values(found.best), meaning, came_from)


def summarise_tuning(tuned: Tuned, folds: int) -> dict[str, Any]:
    """All that is known of a tuning, as it is written to summary.json.

    Parameters
    ----------
    folds : asked for; an interruption may have left fewer.
    """
    found, history, job = tuned.search, tuned.search.history, tuned.problem.job
    following = job.system.following if job.follows else None
    before, after = (_by_case(tuned, z_k) for z_k in (tuned.before, found.z_k))
    return {
        "estimator": job.estimator,
        "label": estimators(job.system)[job.estimator].label,
        "judged": job.system.objective.judged,
        "bandwidth": _finite(job.system.objective.bandwidth),
        "follows": None if following is None else vars(following),
        "z": found.z,
        "z_reasoned": max(before.values()),
        "cases": {
            name: {
                "z_k": after[name],
                "z_k_reasoned": before[name],
                "unstable": sum(g.unstable.get(name, 0) for g in history),
            }
            for name in after
        },
        "gains": _gains(tuned),
        "sensitivity": {
            e.gain: {
                "less": _finite(e.less),
                "more": _finite(e.more),
                "without": _finite(e.without),
                "matters": e.matters,
            }
            for e in tuned.sensitivities
        },
        "folds": [
            {name: _finite(v) if isinstance(v, float) else v for name, v in asdict(fold).items()}
            for fold in tuned.folds
        ],
        "beside": {
            name: {
                "label": estimators(job.system)[name].label,
                "z": _finite(float(z_k.max())),
                "worst": list(after)[int(z_k.argmax())],
            }
            for name, z_k in tuned.beside.items()
        },
        "work": {
            "generations": len(history) - 1,
            "candidates": sum(g.candidates for g in history),
            "seconds": sum(g.seconds for g in history),
            "saved": 1.0 - sum(g.samples for g in history) / sum(g.of for g in history),
            "crashed": sum(g.crashed for g in history),
            "interrupted": found.interrupted,
            "converged": found.converged,
            "as_good": len(_as_good(tuned)),
            "last": len(found.last.z),
            "folds": folds,
        },
        "convergence": [g.z for g in history],
        "provenance": _provenance(tuned),
    }


def _provenance(tuned: Tuned) -> dict[str, Any]:
    plan = tuned.plan
    return {**tuned.problem.provenance, "seed": plan.seed, "population": plan.population}


def _by_case(tuned: Tuned, z_k: Vector) -> dict[str, float]:
    names = (recording.name for recording in tuned.problem.job.recordings)
    return dict(zip(names, z_k.tolist(), strict=True))


def _gains(tuned: Tuned) -> dict[str, dict[str, Any]]:
    job, space, found = tuned.problem.job, tuned.problem.space, tuned.search
    names, reasoned = job.gains.names, job.gains.values
    lower, upper = space.gains(np.array([np.zeros(len(names)), np.ones(len(names))]))
    at_bound, as_good = space.at_bound(found.coordinates), _as_good(tuned)
    return {
        name: {
            "meaning": tuned.problem.meanings[name][0],
            "unit": tuned.problem.meanings[name][1],
            "value": float(found.best[i]),
            "reasoned": float(reasoned[i]),
            "lower": float(lower[i]),
            "upper": float(upper[i]),
            "at_bound": bool(at_bound[i]),
            "as_good": [float(as_good[:, i].min()), float(as_good[:, i].max())],
        }
        for i, name in enumerate(names)
    }


def _as_good(tuned: Tuned) -> Matrix:
    """Gains of the last candidates whose z is the best but for what does not matter, (s, n)."""
    last = tuned.search.last
    return tuned.problem.space.gains(last.members[last.z <= (1.0 + NEGLIGIBLE) * last.z[0]])


def _finite(value: float) -> float | None:
    """JSON has no infinity."""
    return value if np.isfinite(value) else None
