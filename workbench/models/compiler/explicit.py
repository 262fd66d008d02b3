"""Flat equations to an explicit state space, stage 2 of the compiler.

Equations are matched to unknowns and sorted into blocks (Dulmage-Mendelsohn), linear blocks are
solved symbolically. Velocities of spring-dampers, `der(e)` of an algebraic `e`, follow by the chain
rule along the states. Blocks that are nonlinear in their unknowns are refused: none of the rig's
models needs an iteration inside the right-hand side, and an observer's step should have none.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from workbench.errors import InputError
from workbench.models.compiler.flat import FlatModel, FlatVariable

# Share of the largest coefficient of its column below which an expression is no pivot.
_PIVOT = 1e-3


Incidence = NDArray[np.bool_]


@dataclass(frozen=True)
class StateSpace:
    """der(x) = f(t, x, u, p), w = g(t, x, u, p), all symbolic.

    Attributes
    ----------
    t, x, u, p : symbols: (), (n,), (m,), (k,).
    f : (n,) derivatives of the states.
    w : (l,) top-level outputs that are no states.
    assertions : (a,) conditions, 1 where they hold.
    states, inputs, parameters, outputs : the variables behind x, u, p, w.
    state_outputs : names of the states that the model declares as outputs.
    experiment : numbers of the model's experiment annotation.
    """

    name: str
    description: str
    experiment: dict[str, float]
    t: ca.SX
    x: ca.SX
    u: ca.SX
    p: ca.SX
    f: ca.SX
    w: ca.SX
    assertions: ca.SX
    assertion_texts: list[str]
    states: list[FlatVariable]
    inputs: list[FlatVariable]
    parameters: list[FlatVariable]
    tunable: list[bool]
    outputs: list[FlatVariable]
    state_outputs: list[str]


def make_explicit(model: FlatModel) -> StateSpace:
    """Solve the flat model for state derivatives and outputs.

    Raises
    ------
    InputError
        If equations and unknowns do not match, or a block is nonlinear in its unknowns.
    """
    x, u, p = (
        _column([v.symbol for v in group])
        for group in (model.states, model.inputs, model.parameters)
    )
    n = len(model.states)
    state_rates = _column(model.derivatives[:n])
    dependent_rates = _column(model.derivatives[n:])
    dependent = _column([v.symbol for v in model.dependent])
    algebraic = ca.vertcat(dependent, *(v.symbol for v in model.algebraic))
    rates = ca.vertcat(state_rates, dependent_rates)

    solver = _Solver(model)
    unknowns = ca.vertcat(rates, algebraic)
    pending = list(range(len(model.dependent)))
    while pending:
        # What the states alone determine (positions, then velocities) gives its own derivative.
        solver.solve_determined(unknowns)
        expressions = solver.resolve(dependent)
        free = [bool(row.any()) for row in _incidence(expressions, ca.vertcat(unknowns, u))]
        ready = [i for i in pending if not free[i]]
        if not ready:
            names = [model.dependent[i].name for i in pending]
            raise _singular(model, names, "no equation gives them without derivatives or inputs")
        known = expressions[ready]
        change = ca.jtimes(known, x, state_rates) + ca.jacobian(known, model.time)
        solver.equate(dependent_rates[ready], change)
        pending = [i for i in pending if free[i]]
    solver.solve_all(unknowns)

    by_name = {v.name: v for v in [*model.states, *model.dependent, *model.algebraic]}
    state_names = {v.name for v in model.states}
    outputs = [by_name[name] for name in model.outputs if name not in state_names]
    conditions = _column([condition for condition, _ in model.assertions])
    return StateSpace(
        name=model.name,
        description=model.description,
        experiment=model.experiment,
        t=model.time,
        x=x,
        u=u,
        p=p,
        f=solver.resolve(state_rates),
        w=solver.resolve(_column([v.symbol for v in outputs])),
        assertions=solver.resolve(conditions),
        assertion_texts=[text for _, text in model.assertions],
        states=model.states,
        inputs=model.inputs,
        parameters=model.parameters,
        tunable=model.tunable,
        outputs=outputs,
        state_outputs=[name for name in model.outputs if name in state_names],
    )


def _column(entries: Sequence[ca.SX]) -> ca.SX:
    return ca.vertcat(ca.SX(0, 1), *entries)


def _incidence(expression: ca.SX, symbols: ca.SX) -> Incidence:
    """(rows, symbols) True where a row depends on a symbol."""
    incidence = np.zeros((expression.numel(), symbols.numel()), bool)
    incidence[tuple(ca.jacobian_sparsity(expression, symbols).get_triplet())] = True
    return incidence


def _singular(model: FlatModel, names: Sequence[str], reason: str) -> InputError:
    listed = ", ".join(names[:6]) + (" ..." if len(names) > 6 else "")
    return InputError(
        where=f"model {model.name}",
        found=f"unknowns that cannot be solved for: {listed} ({reason})",
        expected="as many independent equations as unknowns, linear within each loop",
        remedy="check connects and start values: states carry start and fixed = true, on one side "
        "only of a rigid coupling",
    )


class _Solver:
    """Residuals that are not yet used, and the solution so far (name -> expression)."""

    def __init__(self, model: FlatModel) -> None:
        self.model = model
        self.residuals = ca.vertcat(*(residual for residual, _ in model.equations))
        self.places = [place for _, place in model.equations]
        self.state_rates = {s.name() for s in model.derivatives[: len(model.states)]}
        self.solution: dict[str, ca.SX] = {}
        self.start = {v.symbol.name(): v.start for v in [*model.states, *model.parameters]}

    def equate(self, symbols: ca.SX, expressions: ca.SX) -> None:
        """Add symbol = expression as equations."""
        self.residuals = ca.vertcat(self.residuals, symbols - expressions)
        self.places += [self.model.name] * symbols.numel()

    def resolve(self, expression: ca.SX) -> ca.SX:
        """Insert the solution: what is left are t, x, u, p (and unknowns not solved yet)."""
        known = [s for s in ca.symvar(expression) if s.name() in self.solution]
        if not known:
            return expression
        definitions = ca.vertcat(*(self.solution[s.name()] for s in known))
        return ca.substitute(expression, ca.vertcat(*known), definitions)

    def solve_determined(self, unknowns: ca.SX) -> None:
        """Solve the part of the equations that is square, leave the rest for later."""
        left = self._unsolved(unknowns)
        _, row_order, column_order, row_blocks, column_blocks, coarse_rows, _ = _pattern(
            _incidence(self.residuals, left)
        ).btf()
        square = slice(coarse_rows[2], coarse_rows[3])
        self._solve_blocks(row_order, column_order, row_blocks, column_blocks, left, square)

    def solve_all(self, unknowns: ca.SX) -> None:
        """Solve all remaining equations for all remaining unknowns."""
        left = self._unsolved(unknowns)
        incidence = _incidence(self.residuals, left)
        rank = ca.sprank(ca.DM(_pattern(incidence), 1))
        if not incidence.shape[0] == incidence.shape[1] == rank:
            raise self._structurally_singular(incidence, left)
        _, row_order, column_order, row_blocks, column_blocks, _, _ = _pattern(incidence).btf()
        self._solve_blocks(
            row_order,
            column_order,
            row_blocks,
            column_blocks,
            left,
            slice(0, incidence.shape[0]),
        )

    def _unsolved(self, unknowns: ca.SX) -> ca.SX:
        return _column([s for s in ca.vertsplit(unknowns) if s.name() not in self.solution])

    def _structurally_singular(self, incidence: Incidence, unknowns: ca.SX) -> InputError:
        unused = [unknowns[j].name() for j in range(unknowns.numel()) if not incidence[:, j].any()]
        names = unused or [symbol.name() for symbol in ca.vertsplit(unknowns)]
        rows, columns = incidence.shape
        return _singular(self.model, names, f"{rows} equations for {columns} unknowns")

    def _solve_blocks(
        self,
        rows: Sequence[int],
        columns: Sequence[int],
        row_blocks: Sequence[int],
        column_blocks: Sequence[int],
        unknowns: ca.SX,
        window: slice,
    ) -> None:
        """Solve the diagonal blocks inside `window`; CasADi lists them in order of evaluation."""
        used: list[int] = []
        blocks = [
            (
                rows[row_blocks[b] : row_blocks[b + 1]],
                columns[column_blocks[b] : column_blocks[b + 1]],
            )
            for b in range(len(row_blocks) - 1)
            if window.start <= row_blocks[b] < window.stop
        ]
        for block_rows, block_columns in blocks:
            self._solve_block(list(block_rows), unknowns[list(block_columns)])
            used += block_rows
        keep = sorted(set(range(self.residuals.numel())) - set(used))
        self.residuals = self.residuals[keep] if keep else ca.SX(0, 1)
        self.places = [self.places[i] for i in keep]

    def _solve_block(self, rows: list[int], unknowns: ca.SX) -> None:
        residual = self.residuals[rows]
        coefficients = ca.jacobian(residual, unknowns)
        if ca.depends_on(coefficients, unknowns):
            names = [s.name() for s in ca.vertsplit(unknowns)]
            places = ", ".join(sorted({self.places[i] for i in rows})[:3])
            raise _singular(self.model, names, f"a nonlinear loop at {places}")
        right_hand = -ca.substitute(residual, unknowns, ca.SX.zeros(unknowns.shape))
        late = np.array([s.name() in self.state_rates for s in ca.vertsplit(unknowns)])
        solved = _eliminate(coefficients, right_hand, unknowns, self._numbers(coefficients), late)
        if solved is None:
            names = [s.name() for s in ca.vertsplit(unknowns)]
            raise _singular(self.model, names, "their equations depend on each other")
        for symbol, expression in solved:
            self.solution[symbol.name()] = self.resolve(expression)

    def _numbers(self, coefficients: ca.SX) -> np.ndarray:
        """Coefficients at the default parameters and the initial state; inputs and time are 0."""
        if coefficients.is_constant():
            return np.array(ca.evalf(ca.densify(coefficients)).full())
        resolved = self.resolve(coefficients)
        symbols = ca.symvar(resolved)
        function = ca.Function("coefficients", [_column(symbols)], [ca.densify(resolved)])
        return np.array(function([self.start.get(s.name(), 0.0) for s in symbols]).full())


def _pattern(incidence: Incidence) -> ca.Sparsity:
    rows, columns = np.nonzero(incidence)
    return ca.Sparsity.triplet(*incidence.shape, [int(r) for r in rows], [int(c) for c in columns])


def _eliminate(
    a: ca.SX, b: ca.SX, unknowns: ca.SX, numbers: np.ndarray, late: np.ndarray
) -> list[tuple[ca.SX, ca.SX]] | None:
    """Solve a*z = b by Gaussian elimination on symbols; returns z in an order of evaluation.

    The pivot is the sparsest choice (Markowitz 1957), constants before expressions, so that
    connect equations vanish before any mass appears in a denominator, and the unknowns marked
    `late` (derivatives of states) last, so that what is left is the mass matrix. An expression
    is a pivot only if its value at the defaults, `numbers`, is not small in its column.
    None if no pivot is left.
    """
    size = a.shape[0]
    rows = [{j: a[i, j] for j in range(size) if not a[i, j].is_zero()} for i in range(size)]
    right = ca.vertsplit(b)
    present = np.array([[j in row for j in range(size)] for row in rows])
    constant = np.array([[j in row and row[j].is_constant() for j in range(size)] for row in rows])
    order: list[tuple[ca.SX, dict[int, ca.SX], ca.SX, ca.SX]] = []
    for _ in range(size):
        large = abs(numbers) >= _PIVOT * abs(numbers * present).max(axis=0)
        cost = np.outer(present.sum(axis=1) - 1, present.sum(axis=0) - 1)
        cost = cost + size**2 * (late + 2 * ~constant)
        cost = np.where(present & (constant | large), cost, np.inf)
        pivot_row, pivot = (int(k) for k in np.unravel_index(cost.argmin(), cost.shape))
        if not np.isfinite(cost[pivot_row, pivot]):
            return None
        leading = rows[pivot_row].pop(pivot)
        order.append((unknowns[pivot], rows[pivot_row], right[pivot_row], leading))
        present[pivot_row] = False
        for i in np.flatnonzero(present[:, pivot]):
            factor = rows[i].pop(pivot) / leading
            present[i, pivot] = False
            for j, coefficient in rows[pivot_row].items():
                rows[i][j] = ca.simplify(rows[i].get(j, ca.SX(0)) - factor * coefficient)
                if rows[i][j].is_zero():
                    del rows[i][j]
                present[i, j] = j in rows[i]
                constant[i, j] = j in rows[i] and rows[i][j].is_constant()
            right[i] = right[i] - factor * right[pivot_row]
            if numbers[i, pivot]:
                numbers[i] -= numbers[i, pivot] / numbers[pivot_row, pivot] * numbers[pivot_row]
    return [
        (symbol, (value - sum((c * unknowns[j] for j, c in row.items()), ca.SX(0))) / leading)
        for symbol, row, value, leading in reversed(order)
    ]
