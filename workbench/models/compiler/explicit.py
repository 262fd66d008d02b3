"""Flat equations to an explicit state space, stage 2 of the compiler.

Equations are matched to unknowns and sorted into blocks (Dulmage-Mendelsohn), linear blocks are
solved symbolically. Velocities of spring-dampers, `der(e)` of an algebraic `e`, follow by the chain
rule along the states. Blocks that are nonlinear in their unknowns are refused: none of the rig's
models needs an iteration inside the right-hand side, and an observer's step should have none.

States are the differentiated variables with `fixed = true`. Where these are too few, others join
them, by stateSelect and start; where equations tie them to each other, they are chosen anew. What
is not fixed begins as initial equations say, else at its start.
"""

import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

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
    x0 : (n,) states at the start, of t, u and p; None where they are the starts of `states`.
    notes : what the user should know, a sentence each.
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
    x0: ca.SX | None = None
    notes: tuple[str, ...] = ()

    @property
    def follows(self) -> bool:
        """Whether the states at the start follow parameters, inputs or time."""
        return self.x0 is not None and not self.x0.is_constant()

    def initial_states(self) -> list[float]:
        """States at the start of the experiment, at the starts of inputs and parameters."""
        if self.x0 is None:
            return [state.start for state in self.states]
        time = self.experiment.get("StartTime", 0.0)
        u, p = ([v.start for v in group] for group in (self.inputs, self.parameters))
        function = ca.Function("x0", [self.t, self.u, self.p], [ca.densify(self.x0)])
        return [float(value) for value in function(time, u, p).full().ravel()]


def make_explicit(model: FlatModel) -> StateSpace:
    """Solve the flat model for state derivatives and outputs.

    Raises
    ------
    InputError
        If equations and unknowns do not match, a block is nonlinear in its unknowns, or the start
        of a state is not given.
    """
    fixed = [v.name for v in model.differentiated if v.fixed and v.select != "Never"]
    solver = _Solver(model, fixed)
    try:
        solver.solve()
    except InputError as error:
        # Equations may tie fixed variables to each other: choose one after the other, from none.
        solver = _Solver(model, [])
        try:
            solver.solve()
        except InputError:
            raise error from None
    states = [v for v in model.differentiated if v.name in solver.states]
    x, u, p = (
        _column([v.symbol for v in group]) for group in (states, model.inputs, model.parameters)
    )
    by_name = {v.name: v for v in [*model.differentiated, *model.algebraic]}
    outputs = [by_name[name] for name in model.outputs if name not in solver.states]
    _refuse_infinite(model, solver)
    x0 = _initial_states(model, solver, states)
    assertions = [*model.assertions, *_finite_starts(states, x0)]
    space = StateSpace(
        name=model.name,
        description=model.description,
        experiment=model.experiment,
        t=model.time,
        x=x,
        u=u,
        p=p,
        f=solver.resolve(_column([solver.rates[v.name] for v in states])),
        w=solver.resolve(_column([v.symbol for v in outputs])),
        assertions=solver.resolve(_column([condition for condition, _ in assertions])),
        assertion_texts=[text for _, text in assertions],
        states=states,
        inputs=model.inputs,
        parameters=model.parameters,
        tunable=model.tunable,
        outputs=outputs,
        state_outputs=[name for name in model.outputs if name in solver.states],
        x0=x0,
        notes=model.notes,
    )
    starts = list(zip(states, space.initial_states(), strict=True))
    for state, start in starts:
        if not math.isfinite(start):
            raise _infinite(state, start)
    return replace(space, states=[replace(state, start=start) for state, start in starts])


def _finite_starts(states: Sequence[FlatVariable], x0: ca.SX) -> list[tuple[ca.SX, str]]:
    """Assertions that what parameters or inputs make of the starts is finite numbers."""
    return [
        (ca.fabs(state.symbol) <= sys.float_info.max, f"{state.name} is a finite number")
        for state, start in zip(states, ca.vertsplit(x0), strict=True)
        if not start.is_constant()
    ]


def _refuse_infinite(model: FlatModel, solver: "_Solver") -> None:
    """Refuse variables that parameters alone give, and that are not finite at the defaults."""
    varying = _column([v.symbol for v in [*model.differentiated, *model.inputs]])
    known = [v for v in model.algebraic if v.symbol.name() in solver.solution]
    values = _column([solver.solution[v.symbol.name()] for v in known])
    constant = np.flatnonzero(~_incidence(values, ca.vertcat(model.time, varying)).any(1))
    parameters = _column([v.symbol for v in model.parameters])
    function = ca.Function("values", [parameters], [ca.densify(values[[int(i) for i in constant]])])
    defaults = [v.start for v in model.parameters]
    for i, value in zip(constant, function(defaults).full().ravel(), strict=True):
        if not math.isfinite(value):
            raise _infinite(known[i], value)


def _infinite(variable: FlatVariable, value: float) -> InputError:
    return InputError(
        where=variable.place,
        found=f"'{variable.name}' = {value:g} at the defaults of the parameters",
        expected="a finite number",
        remedy="correct its equation, or the parameters in it",
    )


def _initial_states(model: FlatModel, solver: "_Solver", states: list[FlatVariable]) -> ca.SX:
    """Solve starts and initial equations for the states at the start.

    A variable with `fixed = true` that is no state is an initial equation, too.
    """
    names = {state.name for state in states}
    others = [v for v in [*model.differentiated, *model.algebraic] if v.name not in names]
    equations = [
        *((solver.resolve(residual), place) for residual, place in model.initial_equations),
        *((solver.resolve(v.symbol) - _start(v), v.place) for v in others if v.fixed),
    ]
    known = {v.name: _start(v) for v in states if v.fixed}
    free = [v for v in states if not v.fixed]
    equations = [(_insert(residual, states, known), place) for residual, place in equations]
    symbols = _column([v.symbol for v in free])
    determining = [e for e in equations if free and ca.depends_on(e[0], symbols)]
    for residual, place in equations:
        if not any(residual is r for r, _ in determining) and not _vanishes(residual, model):
            raise InputError(
                where=place,
                found="an initial value that contradicts those of "
                + ", ".join(v.name for v in states if v.fixed),
                expected="starts that the equations allow, for all values of the parameters",
                remedy="give one of them fixed = false",
            )
    begun = [v for v in free if v.has_start or not determining]
    if determining and len(free) == len(determining):
        begun = []
    unsaid = [v for v in begun if not v.has_start]
    if unsaid and not determining:
        raise InputError(
            where=unsaid[0].place,
            found=f"state '{unsaid[0].name}' without a start",
            expected="a start, or an initial equation",
            remedy="give it a start, with fixed = true",
        )
    if unsaid or len(begun) + len(determining) != len(free):
        raise InputError(
            where=(unsaid or free or states)[0].place,
            found=f"{len(determining)} initial equations for {len(free)} states that are not "
            f"fixed, {', '.join(v.name for v in free)}",
            expected="a start of each state",
            remedy="give a start, with fixed = true, to those that no initial equation determines",
        )
    known |= {v.name: _start(v) for v in begun}
    if determining:
        sought = [v for v in free if v.name not in known]
        known |= _solve_starts(model, solver, determining, sought, known)
    return _column([known[v.name] for v in states])


def _solve_starts(
    model: FlatModel,
    solver: "_Solver",
    equations: Sequence[tuple[ca.SX, str]],
    sought: Sequence[FlatVariable],
    known: Mapping[str, ca.SX],
) -> dict[str, ca.SX]:
    """States at the start that initial equations determine."""
    residual = _column([_insert(r, model.differentiated, known) for r, _ in equations])
    symbols = _column([v.symbol for v in sought])
    coefficients = ca.jacobian(residual, symbols)
    solved = None
    if not ca.depends_on(coefficients, symbols):
        right_hand = -ca.substitute(residual, symbols, ca.SX.zeros(symbols.shape))
        numbers, late = solver.numbers(coefficients), np.zeros(len(sought), bool)
        solved = _eliminate(coefficients, right_hand, symbols, numbers, late)
    if solved is None:
        raise InputError(
            where=equations[0][1],
            found="initial equations that cannot be solved for "
            + ", ".join(v.name for v in sought),
            expected="independent initial equations, linear in the states",
            remedy="give these states a start with fixed = true",
        )
    starts: dict[str, ca.SX] = {}
    for symbol, expression in solved:
        starts[symbol.name()] = _insert(expression, sought, starts)
    return starts


def _start(variable: FlatVariable) -> ca.SX:
    expression = variable.start_expression
    return ca.SX(variable.start) if expression is None else expression


def _insert(
    expression: ca.SX, variables: Sequence[FlatVariable], values: Mapping[str, ca.SX]
) -> ca.SX:
    """Replace variables by their values, those that have one."""
    inserted = [v for v in variables if v.name in values]
    if not inserted:
        return expression
    symbols, new = ([v.symbol for v in inserted], [values[v.name] for v in inserted])
    return ca.substitute(expression, _column(symbols), _column(new))


def _vanishes(residual: ca.SX, model: FlatModel) -> bool:
    """Whether a residual is zero, but for rounding, whatever the parameters."""
    symbols = ca.symvar(residual)
    starts = {v.symbol.name(): v.start for v in [*model.parameters, *model.inputs]}
    defaults = np.array([starts.get(s.name(), 0.0) for s in symbols])
    function = ca.Function("residual", [_column(symbols)], [residual])
    points = (defaults, 1.1 * defaults + 0.1, 0.7 * defaults - 0.3)
    return all(
        abs(float(function(point))) <= 1e-9 * (1.0 + abs(point).max(initial=0.0))
        for point in points
    )


def _column(entries: Sequence[ca.SX]) -> ca.SX:
    return ca.vertcat(ca.SX(0, 1), *entries)


def _incidence(expression: ca.SX, symbols: ca.SX) -> Incidence:
    """(rows, symbols) True where a row depends on a symbol."""
    incidence = np.zeros((expression.numel(), symbols.numel()), bool)
    incidence[tuple(ca.jacobian_sparsity(expression, symbols).get_triplet())] = True
    return incidence


def _singular(model: FlatModel, names: Sequence[str], reason: str, where: str = "") -> InputError:
    listed = ", ".join(names[:6]) + (" ..." if len(names) > 6 else "")
    return InputError(
        where=where or model.place,
        found=f"unknowns that cannot be solved for: {listed} ({reason})",
        expected="as many independent equations as unknowns, linear within each loop",
        remedy="check connects and start values: states carry start and fixed = true, on one side "
        "only of a rigid coupling",
    )


# In this order variables become states. One that is never to be chosen is where nothing else can
# be: the choice changes the numerics, not the solution.
_SELECT = ("Always", "Prefer", "Default", "Avoid", "Never")


class _Solver:
    """Residuals that are not yet used, and the solution so far (name -> expression).

    Attributes
    ----------
    states : names of the variables that are states.
    rates : symbol of the derivative of each differentiated variable.
    """

    def __init__(self, model: FlatModel, states: Sequence[str]) -> None:
        self.model = model
        self.states = set(states)
        names = [v.name for v in model.differentiated]
        self.rates = dict(zip(names, model.rates, strict=True))
        self._rate_of = {rate.name(): name for name, rate in self.rates.items()}
        self.residuals = _column([residual for residual, _ in model.equations])
        self.places = [place for _, place in model.equations]
        self.solution: dict[str, ca.SX] = {}
        known = [*model.differentiated, *model.algebraic, *model.parameters]
        self.start = {v.symbol.name(): v.start for v in known}

    def solve(self) -> None:
        """Solve for all unknowns, and let variables become states where these are too few."""
        model = self.model
        inputs = _column([v.symbol for v in model.inputs])
        pending = [v for v in model.differentiated if v.name not in self.states]
        while pending:
            # What the states alone determine (positions, then velocities) gives its own derivative.
            unknowns = self._unknowns()
            self.solve_determined(unknowns)
            expressions = self.resolve(_column([v.symbol for v in pending]))
            incidence = _incidence(expressions, ca.vertcat(unknowns, inputs))
            ready = [i for i in range(len(pending)) if not incidence[i].any()]
            if ready:
                chosen = [v for v in model.differentiated if v.name in self.states]
                x = _column([v.symbol for v in chosen])
                known = expressions[ready]
                change = ca.jtimes(known, x, _column([self.rates[v.name] for v in chosen]))
                change += ca.jacobian(known, model.time)
                self.equate(_column([self.rates[pending[i].name] for i in ready]), change)
                pending = [v for i, v in enumerate(pending) if i not in ready]
            else:
                pending.remove(self._promote(pending))
        self.solve_all(self._unknowns())

    def _promote(self, pending: Sequence[FlatVariable]) -> FlatVariable:
        """Make a state of the first variable that nothing determines."""
        candidates = [v for v in pending if v.symbol.name() not in self.solution]
        if not candidates:
            first = pending[0]
            solution = self.solution[first.symbol.name()]
            inputs = [v.name for v in self.model.inputs if ca.depends_on(solution, v.symbol)]
            raise InputError(
                where=first.place,
                found=f"der({first.name}), for which der({inputs[0]}) is needed"
                if inputs
                else f"der({first.name}), which no equation gives",
                expected="derivatives of what states and time determine",
                remedy="make the derivative an input of its own, or pass the input through a "
                "first-order lag",
            )
        chosen = min(
            candidates,
            key=lambda v: (
                v.select == "Never",
                v.select != "Always",
                not v.fixed,
                _SELECT.index(v.select),
                not v.has_start,
            ),
        )
        self.states.add(chosen.name)
        return chosen

    def _unknowns(self) -> ca.SX:
        """Rates of the states, of the other differentiated variables, these, and all others."""
        states = [v for v in self.model.differentiated if v.name in self.states]
        dependent = [v for v in self.model.differentiated if v.name not in self.states]
        rates = [self.rates[v.name] for v in [*states, *dependent]]
        return _column([*rates, *(v.symbol for v in [*dependent, *self.model.algebraic])])

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
            names = [symbol.name() for symbol in ca.vertsplit(left)]
            unused = [name for j, name in enumerate(names) if not incidence[:, j].any()]
            rows, columns = incidence.shape
            why = f"{rows} equations for {columns} unknowns"
            raise _singular(self.model, unused or names, why)
        _, row_order, column_order, row_blocks, column_blocks, _, _ = _pattern(incidence).btf()
        self._solve_blocks(
            row_order, column_order, row_blocks, column_blocks, left, slice(0, incidence.shape[0])
        )

    def _unsolved(self, unknowns: ca.SX) -> ca.SX:
        return _column([s for s in ca.vertsplit(unknowns) if s.name() not in self.solution])

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
            where, *others = sorted({self.places[i] for i in rows})
            more = f", with {', '.join(others[:2])}" if others else ""
            raise InputError(
                where=where,
                found=f"a nonlinear loop: equations that cannot be solved for {', '.join(names)}"
                + more,
                expected="equations that are linear in what they are solved for",
                remedy="solve them by hand, make one of these variables a fast state, or export "
                "the model as an FMU from a tool that iterates",
            )
        right_hand = -ca.substitute(residual, unknowns, ca.SX.zeros(unknowns.shape))
        rate_of = [self._rate_of.get(s.name()) for s in ca.vertsplit(unknowns)]
        late = np.array([name in self.states for name in rate_of])
        solved = _eliminate(coefficients, right_hand, unknowns, self.numbers(coefficients), late)
        if solved is None:
            names = [s.name() for s in ca.vertsplit(unknowns)]
            where = self.places[rows[0]]
            raise _singular(self.model, names, "their equations depend on each other", where)
        for symbol, expression in solved:
            self.solution[symbol.name()] = self.resolve(expression)

    def numbers(self, coefficients: ca.SX) -> np.ndarray:
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
