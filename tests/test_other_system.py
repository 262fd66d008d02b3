"""A machine of another kind, by its system file alone, is simulated, drawn and tested alike."""

from dataclasses import replace

import lxml.html
import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from workbench.models.fmu import FMU
from workbench.observers import choose
from workbench.observers.observability import case_observability, linear_test
from workbench.observers.observability_report import (
    draw_observability,
    format_observability,
    write_observability,
    write_windows,
)
from workbench.observers.report import format_table, summarise_runs, write_estimates, write_page
from workbench.observers.simulation import CaseResult, case_figure, prepare, simulate
from workbench.pages.provenance import run_of
from workbench.pages.views import views
from workbench.recordings.case import Case, read_case
from workbench.system.registry import open_model
from workbench.system.system import System

from .built import declare, machine, write_case

TRUE_LOSS = 14.0  # [W/K], nominal is 10


@pytest.fixture(scope="module")
def boiler(tmp_path_factory) -> System:
    return declare(tmp_path_factory.mktemp("boiler"), *machine("boiler"), Vessel="Boiler.Vessel")


@pytest.fixture(scope="module")
def case(boiler, tmp_path_factory) -> Case:
    """Ten minutes of heating a vessel that loses more than its model says."""
    folder = tmp_path_factory.mktemp("case") / "01_heating"
    time = np.arange(0.0, 600.0, 0.5)
    power = np.where(time > 20.0, 800.0, 0.0)
    rows = []
    with FMU(boiler.models["observer"].path) as fmu:
        fmu.start({}, {"G": TRUE_LOSS})
        driven, seen = fmu.variables(["P"]), fmu.variables(["TSkin", "T"])
        for value in power:
            fmu.set(driven, np.array([value]))
            rows.append(fmu.get(seen).copy())
            fmu.step(0.5)
    rng = np.random.default_rng(1)
    noisy = np.array(rows) + rng.normal(0.0, 0.02, (time.size, 2))
    columns = {"time [s]": time, "P [W]": power, "TSkin [K]": noisy[:, 0], "T [K]": noisy[:, 1]}
    return read_case(write_case(folder, columns, "Heating"), boiler)


@pytest.fixture(scope="module")
def result(boiler, case) -> CaseResult:
    (result,) = simulate(prepare(boiler, choose(boiler, [])), [case])
    return result


def test_every_general_estimator_finds_the_loss(result):
    assert {"open_loop", "disturbance_observer", "parameter_estimator", "ekf", "ukf"} <= set(
        result.runs
    )
    for name, run in result.runs.items():
        assert run.ending.name == "OK"
        if name != "open_loop":
            # 2 % of the loss are 0.3 W/K, three times the walk that is allowed within a second.
            assert_allclose(run.signal("G")[-100:].mean(), TRUE_LOSS, rtol=0.02)
            # The slowest, whose integral takes six minutes, has most of its error while it learns.
            assert result.scores[name].nrmse < 0.25 * result.scores["open_loop"].nrmse


def test_panels_follow_from_signals_where_none_are_declared(result):
    assert [panel.title for panel in case_figure(result).panels] == [
        "Temperature of the skin TSkin [K]",
        "Heating power P [kW]",
        "Temperature of the water T [K]",
        "Error of T, estimated - measured [K]",
        "Loss G [W/K]",
    ]
    assert result.case["P"].max() / 1e3 < case_figure(result).panels[1].high < 1.0


def test_outputs_of_one_unit_share_a_panel(boiler):
    """Where another signal is judged, which has a panel of its own."""
    room = replace(boiler.outputs[0], name="TRoom", label="temperature of the room")
    other = replace(
        boiler, reference_signals=(room,), objective=replace(boiler.objective, signal=room.name)
    )
    titles = [view.title for view in views(other)]
    assert titles[0] == "Temperature of the skin TSkin (solid), temperature of the water T (dashed)"
    assert "Temperature of the room TRoom" in titles


def test_percent_of_an_absolute_temperature_is_said_in_kelvin_and_of_its_range(result):
    """An error of 1 K is 0.3 % of 300 K, and much of what a vessel warms up by."""
    warm = 293.0 + np.linspace(0.0, 14.0, result.case.time.size)  # mean 300 K
    absolute = replace(result.case, signals={**result.case.signals, "T": warm})
    note = "T moves by 14 K, far from zero: 1 % of its mean is 3 K, which is 21 % of that"
    assert replace(result, case=absolute).scale_notes() == [note]
    assert f"01_heating: {note}." in format_table(result.system, [replace(result, case=absolute)])
    above = replace(absolute, signals={**absolute.signals, "T": warm - 293.0})
    assert not replace(result, case=above).scale_notes()


def test_table_and_page_speak_of_the_judged_signal(result, tmp_path):
    system = result.system
    table = format_table(system, [result])
    assert table.startswith("Error of T, rms / mean (over the whole recording)")
    provenance = {
        "run": run_of("simulate", system, {}),
        "workbench": "0",
        "commit": None,
        "python": "3",
        "packages": {},
        "fmu": {"file": "Vessel.fmu", "model": "Vessel", "sha256": "0" * 64},
    }
    summary = summarise_runs(system, [result], provenance)
    assert {"T_rms_K", "T_nrmse"} <= set(summary["cases"]["01_heating"]["estimators"]["ekf"])
    # Nothing says otherwise: each deviation counts by the size of its signal.
    assert summary["weights"] == {"TSkin": 0.02, "T": 0.02}
    write_page(system, summary, [case_figure(result)], 1, tmp_path / "index.html")
    page = lxml.html.fromstring((tmp_path / "index.html").read_bytes())
    for script in page.xpath("//script"):  # and samples, which may hold any letters
        script.drop_tree()
    text = page.text_content()
    assert "Temperature of the water estimated on one recording" in text
    assert "0.02 1/K · |error of T|" in text
    for word in ("Hz", "force", "friction", "brak", "omega"):
        assert word not in text


def test_columns_of_the_data_are_the_signals(result, tmp_path):
    write_estimates(result, tmp_path / "case.csv")
    columns = list(pd.read_csv(tmp_path / "case.csv"))
    assert columns[:4] == ["time [s]", "measured.P [W]", "measured.TSkin [K]", "measured.T [K]"]
    assert {"ekf.G [W/K]", "ekf.sigma_G [W/K]", "ekf.T_error [K]"} <= set(columns)
    assert not [name for name in columns if "claimed" in name]


def test_results_are_tables_figures_and_text_in_a_notebook(result):
    run = result.runs["ekf"]
    assert list(run.to_frame())[:2] == ["time [s]", "TSkin [K]"]
    assert len(run.plot().axes) == len(run.columns)
    assert len(result.plot().axes) == 5
    assert "ekf on 01_heating: ran to the end" in run.summary()
    assert run.to_dict()["samples"] == run.time.size
    assert "<table" in run._repr_html_()
    assert "<table" in result._repr_html_()
    assert "T_nrmse" in result.summary()


def test_outputs_that_are_no_states_tell_of_states_and_loss(boiler, case, tmp_path):
    with open_model(boiler) as fmu:
        linear = linear_test(fmu, boiler)
    assert linear.observable
    observed = case_observability(boiler, {"observer": linear.scale}, case)
    # Nothing is lost to a room of the same temperature: before it is heated only the prior holds.
    prior = (40.0 - 1.0) / np.sqrt(12.0)
    assert_allclose(observed.tests[0].bound[:20, 0], prior, rtol=0.01)
    assert observed.tests[0].bound[-1, 0] < 0.5 * prior
    write_windows(observed, tmp_path / "case.csv")
    draw_observability(observed, tmp_path / "case.png")
    write_observability(boiler, [linear], [observed], {}, tmp_path / "observability.json")
    assert "Vessel.bound_dG [W/K]" in pd.read_csv(tmp_path / "case.csv")
    assert "Vessel: rank 2 of 2, observable" in format_observability(boiler, [linear], [observed])
