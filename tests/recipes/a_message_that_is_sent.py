"""A message that is sent"""

CHANGES = {
    "h2nav/wire/outbound.py": (
        (
            "def named_value_float(",
            '''\
def made(t_us: int) -> OutMessage:
    """VIBRATION."""
    return mavlink.MAVLink_vibration_message(t_us, 0.0, 0.0, 0.0, 0, 0, 0)


def named_value_float(''',
        ),
    ),
    "h2nav/service/outputs.py": (
        (
            "            mavlink.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT: _Output(\n",
            """\
            mavlink.MAVLINK_MSG_ID_VIBRATION: _Output(
                lambda estimate: (outbound.made(estimate.t_us),),
                settings.made_rate_hz,
            ),
            mavlink.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT: _Output(
""",
        ),
    ),
    "h2nav/service/settings.py": (
        (
            "    difference_rate_hz: RateHz = 0.0\n",
            """\
    difference_rate_hz: RateHz = 0.0
    made_rate_hz: RateHz = 5.0
""",
        ),
    ),
}

if __name__ == "__main__":
    from h2nav.attitude.samples import AttitudeEstimate, Trust
    from h2nav.service.outputs import Outputs
    from h2nav.service.settings import OutputSettings

    outputs, zero = Outputs(OutputSettings()), (0.0, 0.0, 0.0)
    sent = []
    for ms in range(1000, 3000, 10):
        estimate = AttitudeEstimate(
            1000 * ms, (1.0, 0.0, 0.0, 0.0), zero, zero, zero, 0.01, Trust.ALIGNED, 0.02
        )
        sent += [m for m in outputs.due(estimate) if m.get_type() == "VIBRATION"]
    assert sent[0].time_usec == 1000000
    assert 10 <= len(sent) <= 11
    assert outputs.latest(sent[0].get_msgId())[0].time_usec == 2990000
