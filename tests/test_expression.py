"""Formulas of a system file: arithmetic and nothing else."""

import pickle
import re

import numpy as np
import pytest
from numpy.testing import assert_allclose

from workbench.errors import InputError
from workbench.system.expression import Expression


def test_a_formula_is_ordinary_arithmetic_over_names_with_dots():
    formula = Expression("-2*abs(pump.flow - 1) + max(a, 3)**2/4 - sqrt(b)*sign(c)", "file")
    assert formula.names == {"pump.flow", "a", "b", "c"}
    values = {"pump.flow": 3.0, "a": 1.0, "b": 9.0, "c": -2.0}
    assert formula(values) == -2 * 2 + 9 / 4 + 3


def test_names_may_hold_whole_recordings():
    time = np.linspace(0.0, 1.0, 5)
    assert_allclose(Expression("2*t - offset", "file")({"t": time, "offset": 1.0}), 2 * time - 1)


@pytest.mark.parametrize(
    "text",
    ["__import__('os')", "a if b else c", "a[0]", "abs(x=1)", "'a'", "True", "a +", "", "a < b"],
)
def test_anything_else_is_refused_where_it_stands(text):
    with pytest.raises(InputError, match=r"system\.toml, \[derived\] a is: found .* expected numb"):
        Expression(text, "system.toml, [derived] a is")


@pytest.mark.parametrize("text", ["max(a)", "max(a, b, c)", "sqrt(a, b)"])
def test_functions_take_as_many_arguments_as_they_have(text):
    with pytest.raises(InputError, match=re.escape(f"found '{text}'")):
        Expression(text, "file")


@pytest.mark.parametrize("text", ["1/(a - 1)", "1/0", "9**9**9**9", "sqrt(-a)"])
def test_a_formula_is_read_without_being_worked_out(text):
    assert Expression(text, "file").names <= {"a"}


def test_slopes_are_those_of_a_sum():
    formula = Expression("rR*b - a/2", "file")
    assert formula.slopes(("a", "b"), {"rR": 0.7}) == pytest.approx((-0.5, 0.7), rel=1e-15)


@pytest.mark.parametrize("text", ["a*b", "a + 1", "1/a", "abs(a)", "max(a, b)"])
def test_a_formula_that_is_no_sum_has_no_slopes(text):
    with pytest.raises(InputError, match="expected a sum of a, b, each times a constant"):
        Expression(text, "file").slopes(("a", "b"), {})


def test_a_formula_that_was_used_goes_to_another_process():
    used = Expression("max(a, b)/2", "a file")
    assert used({"a": 1.0, "b": 3.0}) == 1.5
    again = pickle.loads(pickle.dumps(used))
    assert (again, again.where) == (used, "a file")
    assert again({"a": 1.0, "b": 3.0}) == 1.5


def test_a_name_of_any_spelling_stands_in_quotes():
    formula = Expression("2*\"der(x)\" + 'pump flow'", "system.toml")
    assert formula.names == {"der(x)", "'pump flow'"}
    assert formula({"der(x)": 1.5, "'pump flow'": 1.0}) == 4.0
    assert Expression.of("'pump flow'", "").names == {"'pump flow'"}
    assert Expression.of("tank[1].level (m)", "").names == {"tank[1].level (m)"}
