from pathlib import Path

import numpy as np
import pytest

from h2nav.errors import BadInput
from h2nav.recordings.trials import read_trial, trial_paths, usual_rate_hz


def arrays(count: int = 20) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(1)
    mag = rng.normal(size=(count, 3))
    mag[1::2] = np.nan
    q = np.zeros((count, 4))
    q[:, 0] = 1.0
    return {
        "fs": np.array(50.0),
        "gyr": rng.normal(size=(count, 3)).astype(np.float32),
        "acc": rng.normal(size=(count, 3)).astype(np.float32),
        "mag": mag,
        "q": q,
        "mask": np.arange(count) > 4,
        "heading_fixed": np.array(False),
    }


def write(folder: Path, name: str = "trial", **changes: object) -> Path:
    content = {k: v for k, v in (arrays() | changes).items() if v is not None}
    path = folder / f"{name}.npz"
    np.savez(path, **content)
    return path


def test_reads_every_key(tmp_path: Path) -> None:
    trial = read_trial(write(tmp_path))
    assert trial.name == "trial"
    assert trial.rate_hz == 50.0
    assert trial.t_us[:3].tolist() == [0, 20_000, 40_000]
    assert trial.m_s is not None
    assert np.isnan(trial.m_s[1]).all()
    assert trial.mask.sum() == 15
    assert not trial.heading_fixed
    assert trial.gps is None


def test_true_times_win_over_the_rate(tmp_path: Path) -> None:
    t = 100.0 + np.cumsum(np.tile([0.01, 0.03], 10))
    gps = np.array([[100.5, 3.0, 90.0, 12.0]])
    trial = read_trial(write(tmp_path, t=t, gps=gps))
    assert np.diff(trial.t_us).tolist()[:2] == [30_000, 10_000]
    assert trial.gps is not None
    assert trial.gps[0, 0] == pytest.approx(100.5 - t[0])


def test_what_is_optional_may_be_absent(tmp_path: Path) -> None:
    path = write(tmp_path, mag=None, q=None, mask=None, heading_fixed=None)
    trial = read_trial(path)
    assert trial.m_s is None
    assert trial.q_es is None
    assert trial.mask.all()
    assert trial.heading_fixed
    assert trial.declination_rad == 0.0


def test_truth_that_is_not_finite_is_not_scored(tmp_path: Path) -> None:
    q = arrays()["q"]
    q[10] = np.nan
    assert not read_trial(write(tmp_path, q=q)).mask[10]


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"gyr": None}, "gyr: missing"),
        ({"fs": None}, "fs: missing"),
        ({"fs": np.array(0.0)}, "fs: expected one rate"),
        ({"fs": np.array([1.0, 2.0])}, "fs: expected one rate"),
        ({"acc": np.zeros((3, 3))}, "acc: expected numbers of shape"),
        ({"q": np.zeros((20, 3))}, "q: expected numbers of shape"),
        ({"mask": np.array(["a"] * 20)}, "mask: expected numbers"),
        ({"t": np.zeros(20)}, "t: expected finite times"),
        ({"gps": np.zeros(4)}, "gps: expected an array"),
        ({"gyr": np.zeros(3)}, "gyr: expected an array"),
    ],
)
def test_names_file_and_key_of_an_error(
    tmp_path: Path, changes: dict[str, object], expected: str
) -> None:
    path = write(tmp_path, **changes)
    with pytest.raises(BadInput) as caught:
        read_trial(path)
    assert expected in str(caught.value)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("rate_hz", "is_read"), [(0.99, False), (1.0, True), (100_000.0, True), (100_001.0, False)]
)
def test_the_range_of_rates_is_inclusive(tmp_path: Path, rate_hz: float, is_read: bool) -> None:
    path = write(tmp_path, fs=np.array(rate_hz))
    if is_read:
        assert read_trial(path).rate_hz == rate_hz
    else:
        with pytest.raises(BadInput, match="from 1 to 100000 Hz"):
            read_trial(path)


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("heading_fixed", np.array([True, False]), "heading_fixed: expected one truth value"),
        ("gps", np.zeros((2, 3)), "gps: expected an array of shape (M, 4), found (2, 3)"),
        ("mask", np.ones(19), "mask: expected numbers of shape (20,), found (19,)"),
        ("t", np.arange(21.0), "t: expected numbers of shape (20,), found (21,)"),
        ("mag", np.zeros((20, 4)), "mag: expected numbers of shape (20, 3), found (20, 4)"),
        ("fs", np.array([50.0]), "fs: expected one rate in Hz, found shape (1,)"),
        ("gyr", np.zeros((1, 3)), "gyr: expected at least 2 samples, found 1"),
        ("t", np.arange(20.0) * 1e8, "t: expected finite times"),
        ("t", np.arange(20.0) * 1e-7, "t: expected finite times"),
        ("t", np.append(np.arange(19.0), np.nan), "t: expected finite times"),
    ],
)
def test_what_is_expected_is_told(
    tmp_path: Path, key: str, value: np.ndarray, expected: str
) -> None:
    path = write(tmp_path, **{key: value})
    with pytest.raises(BadInput) as caught:
        read_trial(path)
    assert any(line.startswith(f"{path}: {expected}") for line in caught.value.lines)


@pytest.mark.parametrize("content", [b"", b"no archive", b"PK\x03\x04 and then nothing"])
def test_a_file_that_is_no_archive(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "broken.npz"
    path.write_bytes(content)
    with pytest.raises(BadInput, match="not a readable"):
        read_trial(path)


def test_an_archive_that_would_run_code_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "objects.npz"
    np.savez(path, gyr=np.array([{"a": 1}], dtype=object))
    with pytest.raises(BadInput, match="gyr: expected numbers, found object"):
        read_trial(path)


def test_folders(tmp_path: Path) -> None:
    one, two = write(tmp_path, "b"), write(tmp_path, "a")
    assert trial_paths(tmp_path) == [two, one]
    assert trial_paths(one) == [one]
    with pytest.raises(BadInput, match="no such file or folder"):
        trial_paths(tmp_path / "absent")
    (tmp_path / "empty").mkdir()
    with pytest.raises(BadInput, match="no trials in this folder"):
        trial_paths(tmp_path / "empty")


def test_all_that_is_missing_is_told_at_once(tmp_path: Path) -> None:
    path = write(tmp_path, gyr=None, acc=None, fs=None, q=None)
    with pytest.raises(BadInput) as caught:
        read_trial(path)
    assert caught.value.lines == (
        f"{path}: gyr: missing; the trial form needs it",
        f"{path}: acc: missing; the trial form needs it",
        f"{path}: fs: missing; give the rate in Hz, or the times t in s",
        f"{path}: q: missing; without truth nothing can be scored",
    )


def test_a_truth_that_is_no_rotation_is_not_scored(tmp_path: Path) -> None:
    lengths = np.ones(20)
    lengths[[5, 6, 7]] = (0.0, 0.5, 0.51)
    found = read_trial(write(tmp_path, q=arrays()["q"] * lengths[:, None], mask=np.ones(20)))
    assert found.mask[5:8].tolist() == [False, False, True]
    assert found.mask.sum() == 18


@pytest.mark.parametrize(
    ("steps_us", "rate_hz"),
    [
        ([10_000] * 9, 100.0),
        ([10_000, 10_000, 11_000], 3e6 / 31_000),  # of whole milliseconds
        ([10_000, 10_000, 15_000], 3e6 / 35_000),
        ([10_000, 10_000, 15_001], 100.0),  # a gap
    ],
)
def test_the_usual_rate_is_that_between_gaps(steps_us: list[int], rate_hz: float) -> None:
    assert usual_rate_hz(np.cumsum([0, *steps_us])) == pytest.approx(rate_hz)
