"""An explicit state space to C, stage 3 of the compiler.

The C is written for readers too: one static-free function per evaluation, straight-line code over
named arrays, constants with all their digits. `runtime/model.h` documents the interface.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import casadi as ca

from workbench.errors import InputError
from workbench.models.compiler.explicit import StateSpace

_INFIX = {ca.OP_ADD: "+", ca.OP_SUB: "-", ca.OP_MUL: "*", ca.OP_DIV: "/"}
_COMPARE = {
    ca.OP_LT: "<",
    ca.OP_LE: "<=",
    ca.OP_EQ: "==",
    ca.OP_NE: "!=",
    ca.OP_AND: "&&",
    ca.OP_OR: "||",
}
# Functions of math.h, which CasADi calls by the same names in capitals.
_FUNCTIONS = {
    getattr(ca, f"OP_{name.upper()}"): name
    for name in (
        *("exp", "log", "pow", "sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "atan2"),
        *("sinh", "cosh", "tanh", "fabs", "fmin", "fmax", "floor", "ceil"),
    )
} | {ca.OP_CONSTPOW: "pow"}
_FORMS = {
    ca.OP_ASSIGN: "{0}",
    ca.OP_NEG: "-{0}",
    ca.OP_SQ: "{0}*{0}",
    ca.OP_TWICE: "2*{0}",
    ca.OP_INV: "1/{0}",
    ca.OP_NOT: "!{0}",
    ca.OP_SIGN: "({0} > 0) - ({0} < 0)",
    ca.OP_IF_ELSE_ZERO: "{0} != 0 ? {1} : 0",
}
_ARGUMENTS = ("t", "x", "u", "p")


@dataclass(frozen=True)
class GeneratedCode:
    """C sources of a model.

    Attributes
    ----------
    header : text of model_data.h.
    source : text of model.c.
    jacobian_xu, jacobian_p : sparsity of d[f; w]/d[x; u] and d[f; w]/dp.
    """

    header: str
    source: str
    jacobian_xu: ca.Sparsity
    jacobian_p: ca.Sparsity


def generate(model: StateSpace, token: str, prefix: str = "model") -> GeneratedCode:
    """Write the C of a model.

    Parameters
    ----------
    token : identifies the FMU (FMI's guid, instantiationToken).
    prefix : of all names in the source, and name of the header that declares them.
    """
    rows = ca.vertcat(model.f, model.w)
    jacobian_xu = ca.jacobian(rows, ca.vertcat(model.x, model.u))
    jacobian_p = ca.jacobian(rows, model.p)
    evaluations = {
        "derivatives": ("xdot", model.f),
        "algebraics": ("w", model.w),
        "assertions": ("holds", model.assertions),
        **({"starts": ("start", model.x0)} if model.follows and model.x0 is not None else {}),
        "jacobian_xu": ("nonzeros", _nonzeros(jacobian_xu)),
        # At one point they share most of their operations.
        "linearisation": ("values", ca.vertcat(rows, _nonzeros(jacobian_xu))),
        "jacobian_p": ("nonzeros", _nonzeros(jacobian_p)),
    }
    starts = model.initial_states() + [v.start for v in (*model.inputs, *model.parameters)]
    tables = [
        _table("double", f"{prefix}_start", [_number(start) for start in starts]),
        _table("double", f"{prefix}_nominal", [_number(v.nominal or 1.0) for v in model.states]),
        _table("unsigned char", f"{prefix}_tunable", [str(int(t)) for t in model.tunable]),
        _table(
            "char *const", f"{prefix}_assertion_text", [_text(t) for t in model.assertion_texts]
        ),
    ]
    for name, pattern in (("xu", jacobian_xu.sparsity()), ("p", jacobian_p.sparsity())):
        tables += [
            _table("int", f"{prefix}_jacobian_{name}_column", [str(c) for c in pattern.colind()]),
            _table("int", f"{prefix}_jacobian_{name}_row", [str(r) for r in pattern.row()]),
        ]
    functions = [
        _function(model, f"{prefix}_{name}", result, expression)
        for name, (result, expression) in evaluations.items()
    ]
    sizes = {
        "NX": model.x.numel(),
        "NU": model.u.numel(),
        "NP": model.p.numel(),
        "NW": model.w.numel(),
        "NA": model.assertions.numel(),
        "STARTS_FOLLOW": int(model.follows),
        "NNZ_XU": jacobian_xu.nnz(),
        "NNZ_P": jacobian_p.nnz(),
    }
    opening = (
        f'/* Equations of the model {model.name}. */\n#include "{prefix}.h"\n#include <math.h>\n'
    )
    return GeneratedCode(
        header=_header(model.name, token, sizes),
        source="\n".join([opening, *tables, "", *functions]),
        jacobian_xu=jacobian_xu.sparsity(),
        jacobian_p=jacobian_p.sparsity(),
    )


def _header(model: str, token: str, sizes: Mapping[str, int]) -> str:
    lines = [
        f"/* Sizes of the model {model}. */",
        f"#define MODEL_IDENTIFIER {_text(identifier(model))}",
        f"#define MODEL_TOKEN {_text(token)}",
        *(f"#define {name} {size}" for name, size in sizes.items()),
        "",
    ]
    return "\n".join(lines)


def identifier(model: str) -> str:
    """FMI model identifier of a Modelica name: its last part."""
    return model.rsplit(".", 1)[-1]


def _nonzeros(matrix: ca.SX) -> ca.SX:
    return ca.vertcat(*matrix.nonzeros())


def _number(value: float) -> str:
    return repr(float(value))


def _text(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{escaped}"'


def _table(kind: str, name: str, entries: Sequence[str]) -> str:
    # An empty array is no C; a dummy element is never read.
    listed = ", ".join(entries) if entries else "0"
    return f"const {kind} {name}[] = {{{listed}}};"


def _function(model: StateSpace, name: str, result: str, expression: ca.SX) -> str:
    """C text of one evaluation."""
    (shared,) = ca.cse([ca.densify(expression)]) if expression.numel() else (expression,)
    function = ca.Function(name, [model.t, model.x, model.u, model.p], [shared])
    signature = (
        f"int {name}(double t, const double *x, const double *u, const double *p, double *{result})"
    )
    body = list(_statements(model, function, result))
    text = "\n".join(body)
    work = [int(slot) for slot in re.findall(r"\ba\[(\d+)\]", text)]
    declarations = [f"    double a[{max(work) + 1}];"] if work else []
    names = (*_ARGUMENTS, result)
    unused = [f"    (void){n};" for n in names if not re.search(rf"\b{n}\b", text)]
    return "\n".join([signature + " {", *declarations, *unused, *body, "    return 0;", "}", ""])


def _statements(model: StateSpace, function: ca.Function, result: str) -> Iterator[str]:
    """Assignments to work variables a[i] and results; constants and inputs stand in place."""
    slots: dict[int, str] = {}
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        if operation == ca.OP_OUTPUT:
            (source,) = function.instruction_input(k)
            yield f"    {result}[{function.instruction_output(k)[1]}] = {slots[source]};"
            continue
        (slot,) = function.instruction_output(k)
        if operation == ca.OP_CONST:
            constant = function.instruction_constant(k)
            slots[slot] = _number(constant) if constant >= 0 else f"({_number(constant)})"
        elif operation == ca.OP_INPUT:
            argument, element = function.instruction_input(k)
            name = _ARGUMENTS[argument]
            slots[slot] = name if name == "t" else f"{name}[{element}]"
        else:
            operands = [slots[i] for i in function.instruction_input(k)]
            yield f"    a[{slot}] = {_expression(model, operation, operands)};"
            slots[slot] = f"a[{slot}]"


def _expression(model: StateSpace, operation: int, operands: Sequence[str]) -> str:
    if operation in _INFIX:
        return f"{operands[0]} {_INFIX[operation]} {operands[1]}"
    if operation in _COMPARE:
        return f"{operands[0]} {_COMPARE[operation]} {operands[1]}"
    if operation in _FUNCTIONS:
        return f"{_FUNCTIONS[operation]}({', '.join(operands)})"
    if operation in _FORMS:
        return _FORMS[operation].format(*operands)
    raise InputError(
        where=f"model {model.name}",
        found=f"an operation (CasADi number {operation}) that has no C form here",
        expected="elementary functions of Modelica",
        remedy="rewrite the expression",
    )
