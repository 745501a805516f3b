import itertools

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.service.stream_requests import StreamRequests, Wish

RAW = mavlink.MAVLINK_MSG_ID_RAW_IMU
HIGHRES = mavlink.MAVLINK_MSG_ID_HIGHRES_IMU
GPS = mavlink.MAVLINK_MSG_ID_GPS_RAW_INT
SECOND_NS = 1_000_000_000
TARGET = (1, 1)


def asks(requests, seconds, until=1.0, arriving=None, ack=None):
    """Lets time pass in steps of 10 ms; returns (time s, message) of what is asked."""
    asked = []
    for i in range(round((until - seconds) * 100)):
        t_s = seconds + i * 0.01
        for message_id, period in (arriving or {}).items():
            if i % period == 0:
                requests.arrived(message_id)
        requests.measure(round(t_s * SECOND_NS))
        message = requests.next_request(round(t_s * SECOND_NS), TARGET)
        if message is not None:
            asked.append((t_s, message))
            if ack is not None and message.get_type() == "COMMAND_LONG":
                requests.acknowledged(round(t_s * SECOND_NS), ack(int(message.param1)))
    return asked


def accepted(_message_id):
    return mavlink.MAV_RESULT_ACCEPTED


def test_asks_once_with_the_interval_and_is_content_with_the_rate():
    requests = StreamRequests((Wish(RAW, 100.0),))
    asked = asks(requests, 0.0, 20.0, arriving={RAW: 1}, ack=accepted)
    assert len(asked) == 1
    assert (asked[0][1].param1, asked[0][1].param2) == (RAW, 10_000.0)
    assert abs(requests.measured_hz(RAW) - 100.0) < 2.0
    assert list(requests.shortfalls()) == []


def test_a_refused_message_is_followed_by_its_alternative():
    requests = StreamRequests((Wish(HIGHRES, 100.0, (RAW,)),))

    def refuse_highres(message_id):
        return mavlink.MAV_RESULT_DENIED if message_id == HIGHRES else accepted(message_id)

    asked = asks(requests, 0.0, 10.0, arriving={RAW: 1}, ack=refuse_highres)
    assert [int(message.param1) for _, message in asked] == [HIGHRES, RAW]


def test_a_rate_overridden_by_a_ground_station_is_asked_for_again():
    requests = StreamRequests((Wish(RAW, 100.0),))
    asks(requests, 0.0, 6.0, arriving={RAW: 1}, ack=accepted)
    again = asks(requests, 6.0, 12.0, arriving={RAW: 25}, ack=accepted)
    assert len(again) >= 1
    assert [row[0] for row in requests.shortfalls()] in ([RAW], [])


def test_a_shortfall_is_reported_with_both_rates():
    requests = StreamRequests((Wish(RAW, 100.0),))
    asks(requests, 0.0, 2.9, arriving={RAW: 4}, ack=accepted)
    ((message_id, achieved_hz, asked_hz),) = requests.shortfalls()
    assert (message_id, asked_hz) == (RAW, 100.0)
    assert abs(achieved_hz - 25.0) < 1.0


def test_pauses_between_repeated_requests_grow():
    requests = StreamRequests((Wish(RAW, 100.0),))
    times = [t_s for t_s, _ in asks(requests, 0.0, 200.0, ack=accepted)]
    pauses = [after - before for before, after in itertools.pairwise(times)]
    assert pauses[-1] > 3.0 * pauses[0]
    assert len(times) < 12


def test_without_any_answer_the_old_request_is_tried():
    requests = StreamRequests((Wish(RAW, 100.0), Wish(GPS, 5.0)))
    types = [message.get_type() for _, message in asks(requests, 0.0, 30.0)]
    assert types[0] == "COMMAND_LONG"
    assert "REQUEST_DATA_STREAM" in types


def test_everything_is_asked_anew_after_a_reboot():
    requests = StreamRequests((Wish(RAW, 100.0),))
    asks(requests, 0.0, 6.0, arriving={RAW: 1}, ack=accepted)
    requests.restart()
    assert len(asks(requests, 6.0, 6.1, ack=accepted)) == 1


def test_a_request_that_a_reboot_swallowed_is_repeated_at_once():
    requests = StreamRequests((Wish(RAW, 100.0),))
    asks(requests, 0.0, 6.0, arriving={RAW: 1}, ack=accepted)
    # Silence: the next request is lost, the one after it arrives.
    lost = asks(requests, 6.0, 10.0)
    assert lost[1][0] - lost[0][0] < 1.1
