"""A parameter of the gain sets"""

CHANGES = {
    "h2nav/attitude/velocity_aided/parameters.py": (
        (
            '    Parameter("gyro_noise_deg_s_rthz",',
            """\
    Parameter("made_deg", "made", "rad", "a made one", Within(0, 90), None,
              factor=DEG, usual=30.0, absent=60.0),
    Parameter("gyro_noise_deg_s_rthz",""",
        ),
    ),
}

if __name__ == "__main__":
    import math
    from dataclasses import replace

    from h2nav.attitude.velocity_aided.gains import velocity_aided_gains
    from h2nav.files.gain_files import load

    file = load("gains/multirotor_100hz.yaml")
    # A file of a time before the key, and one that has it.
    before = velocity_aided_gains(file, "before").kernel
    with_it = replace(file, gains={**file.gains, "made_deg": 45.0})
    after = velocity_aided_gains(with_it, "after").kernel
    assert math.isclose(before.made, math.radians(60.0))
    assert math.isclose(after.made, math.radians(45.0))
