"""A fault of a campaign"""

CHANGES = {
    "h2nav/sim/faults.py": (
        (
            '    "gyro-bias": _of_imu(',
            '    "made": _of_imu("a made one", 2.0),\n    "gyro-bias": _of_imu(',
        ),
    ),
    "h2nav/sim/sensor_faults.py": (
        (
            '    "gyro-bias": lambda',
            '    "made": lambda s, x: s._replace(w_b=_scaled(s.w_b, x)),\n    "gyro-bias": lambda',
        ),
    ),
    "h2nav/evaluation/campaign/blame.py": (
        ("    (GYRO, GYRO_FAULTS),\n", '    (GYRO, (*GYRO_FAULTS, "made")),\n'),
    ),
    "configs/campaign.yaml": (
        ("    gyro-bias: {log:", "    made: {uniform: [2, 3]}\n    gyro-bias: {log:"),
    ),
}

if __name__ == "__main__":
    from pathlib import Path

    from h2nav.evaluation.campaign.blame import part_of
    from h2nav.evaluation.campaign.distribution import read_distribution

    drawn = read_distribution(Path("configs/campaign.yaml"))
    faults = (fault for seed in range(200) for fault in drawn.draw(seed).scheduled)
    made = [fault for fault in faults if fault.name == "made"]
    assert made
    assert {part_of(fault) for fault in made} == {"gyro"}
    assert all(2.0 <= float(fault.argument) <= 3.0 for fault in made)
