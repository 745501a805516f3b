"""The text and the document of `h2nav evaluate observer`, of made figures."""

import json

import pytest
from one_command import main

from h2nav.apps import evaluate_observer, extras
from h2nav.cli import SUCCESS
from h2nav.evaluation.observer import pictures

DOCUMENT = {
    "conditions": {"convergence": "from far", "noise": "of poses", "vision": "late"},
    "a1": {
        "0.9": {
            "time_to_1e-2_s": 1.0,
            "time_to_1e-4_s": 2.5,
            "time_to_1e-6_s": float("inf"),
            "bias_rms_noisy": 0.1,
            "bias_rms_noisy_rad_s": 0.0123456,
            "bias_rms_noisy_m_s": 0.2,
        }
    },
    "vision": {
        "1.0": {
            "noisy_bias_rms_rad_s": 0.001,
            "noisy_bias_rms_m_s": 0.002,
            "noisy_attitude_rms_rad": 0.003,
            "noisy_position_rms_m": 0.004,
            "noise_free_bias_rms_rad_s": 1.23e-9,
            "noise_free_bias_rms_m_s": 4.5e-10,
        }
    },
}


@pytest.fixture
def required(monkeypatch):
    asked = []
    monkeypatch.setattr(extras, "require", lambda *words: asked.append(words))
    monkeypatch.setattr(evaluate_observer.figures, "convergence", lambda: "courses")
    monkeypatch.setattr(
        evaluate_observer.figures, "document", lambda courses: {**DOCUMENT, "of": courses}
    )
    return asked


def test_people_see_times_and_noise_by_exponent(required, capsys):
    assert main(["evaluate", "observer"]) == SUCCESS
    lines = capsys.readouterr().out.splitlines()
    assert lines[:2] == ["convergence: from far", "noise: of poses"]
    assert lines[3].split() == ["0.9", "1.00", "/", "2.50", "/", "never", "0.01235,", "0.20000"]
    assert lines[4] == "vision: late; rms per axis"
    assert lines[6].split() == [
        "1.0", "0.00100,", "0.00200", "0.00300,", "0.00400", "1.2e-09,", "4.5e-10",
    ]  # fmt: skip
    assert required == []


def test_the_document_has_null_for_a_time_that_is_never_reached(required, capsys):
    assert main(["evaluate", "observer", "--json"]) == SUCCESS
    found = json.loads(capsys.readouterr().out)
    assert found["a1"]["0.9"]["time_to_1e-6_s"] is None
    assert found["of"] == "courses"


def test_pictures_are_drawn_where_they_are_wanted(required, monkeypatch, tmp_path, capsys):
    drawn = []
    monkeypatch.setattr(pictures, "draw", lambda *words: drawn.append(words) or "a.png")
    assert main(["evaluate", "observer", "--json", "--plots", str(tmp_path)]) == SUCCESS
    assert drawn == [(tmp_path, "courses")]
    assert required == [("plots", "--plots", "matplotlib.pyplot")]
    assert capsys.readouterr().err == "wrote a.png\n"
