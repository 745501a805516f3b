"""A sensor error or a range of a campaign"""

CHANGES = {
    "h2nav/evaluation/campaign/draw.py": (
        (
            "    outages_per_h: Size = 0.0\n",
            "    outages_per_h: Size = 0.0\n    made_m_s: Size = 0.0  # off to the north\n",
        ),
    ),
    "h2nav/evaluation/campaign/receiver.py": (
        (
            "    v_n += own.multipath_m_s *",
            "    v_n[:, 0] += own.made_m_s\n    v_n += own.multipath_m_s *",
        ),
    ),
    "configs/campaign.yaml": (
        (
            "  outages_per_h:",
            "  made_m_s: {uniform: [2, 3]}  # a made one\n  outages_per_h:",
        ),
    ),
}

if __name__ == "__main__":
    from dataclasses import replace
    from pathlib import Path

    from h2nav.evaluation.campaign.distribution import read_distribution
    from h2nav.evaluation.campaign.motion import DrawnMotion
    from h2nav.evaluation.campaign.receiver import fixes_of

    drawn = read_distribution(Path("configs/campaign.yaml")).draw(1)
    assert 2.0 <= drawn.receiver.made_m_s <= 3.0
    short = replace(drawn, flight=replace(drawn.flight, length_min=1.0, rest_s=10.0), faults=())
    without = replace(short, receiver=replace(short.receiver, made_m_s=0.0))
    found, usual = (fixes_of(one, DrawnMotion(one)).v_n for one in (short, without))
    assert abs((found - usual)[:, 0] - drawn.receiver.made_m_s).max() < 1e-9
