"""A filter to compare with"""

CHANGES = {
    "h2nav/evaluation/dataset/peers.py": (
        (
            '        "vqf_offline": _vqf_offline,\n',
            '        "vqf_offline": _vqf_offline, "made": _made,\n',
        ),
        (
            "def _vqf(trial: Trial,",
            """\
def _made(trial: Trial, _: Conditions) -> FilterTrack:
    return FilterTrack(np.tile((1.0, 0.0, 0.0, 0.0), (len(trial.w_s), 1)), 0.0, "made")


def _vqf(trial: Trial,""",
        ),
    ),
}

if __name__ == "__main__":
    from h2nav.evaluation.dataset.peers import installed

    assert "made" in installed()
