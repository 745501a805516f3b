import json

import pytest

from h2nav import cli

pytestmark = pytest.mark.thorough


@pytest.fixture(scope="module")
def document(tmp_path_factory):
    """One run of the command, with its picture, through the command line."""
    import contextlib
    import io

    folder = tmp_path_factory.mktemp("plots")
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(io.StringIO()):
        assert cli.main(["evaluate", "observer", "--json", "--plots", str(folder)]) == 0
    assert (folder / "observer_convergence.png").stat().st_size > 10_000
    return json.loads(out.getvalue())


@pytest.mark.parametrize(
    ("a1", "times_s"),
    [("1.0", (5.3, 10.0, 15.1)), ("0.9", (3.8, 5.3, 6.1)), ("0.75", (2.31, 2.55, 2.60))],
)
def test_times_to_a_bias_error_are_within_10_percent(document, a1, times_s):
    row = document["a1"][a1]
    got = [row[f"time_to_1e-{digit}_s"] for digit in (2, 4, 6)]
    assert got == pytest.approx(times_s, rel=0.1)


@pytest.mark.parametrize(("a1", "limit"), [("0.9", 4e-4), ("0.8", 1e-3)])
def test_noise_of_the_bias(document, a1, limit):
    assert 0.0 < document["a1"][a1]["bias_rms_noisy"] <= limit


def test_a_smaller_exponent_is_faster_and_noisier(document):
    rows = [document["a1"][a1] for a1 in ("1.0", "0.9", "0.8", "0.75")]
    times = [row["time_to_1e-6_s"] for row in rows]
    noises = [row["bias_rms_noisy"] for row in rows]
    assert times == sorted(times, reverse=True)
    assert noises == sorted(noises)


@pytest.mark.parametrize("a1", ["1.0", "0.9", "0.85"])
def test_a_real_camera_converges(document, a1):
    row = document["vision"][a1]
    assert row["noise_free_bias_rms_rad_s"] < 1e-8
    assert row["noise_free_bias_rms_m_s"] < 1e-8
    assert row["noisy_bias_rms_rad_s"] < 2e-3
    assert row["noisy_bias_rms_m_s"] < 5e-3
    assert row["noisy_position_rms_m"] < 5e-3  # better than one pose


def test_the_conditions_are_told(document):
    assert "170 deg" in document["conditions"]["convergence"]
