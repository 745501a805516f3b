"""The figures of a campaign: of all flights, of each fault, and the worst flights."""

from collections import Counter
from collections.abc import Callable, Sequence
from statistics import median
from typing import Any

Row = dict[str, Any]

WORST = 20
LONG_S = 10.0
HONEST = (0.3, 3.0)
OUTCOMES = ("right", "late", "undecided", "wrong", "missed")
# What a second of a wrong heading or tilt, a false accusation and a missed fault weigh, so that
# the worst flight is the one to look at first.
ACCUSATION, ALARM, WRONG, MISSED = 60.0, 20.0, 60.0, 30.0


def badness(row: Row) -> float:
    """How bad a flight is; 0 for one without fault."""
    if "heading_deg" not in row:
        return 1e6
    outcomes = Counter(fault["outcome"] for fault in row["faults"])
    return (
        _beyond(row["heading_wrong_s"])
        + _beyond(row["tilt_wrong_s"])
        + ACCUSATION * len(row["false_accusations"])
        + ALARM * len(row["false_alarms"])
        + WRONG * outcomes["wrong"]
        + MISSED * outcomes["missed"]
        + 1e6 * bool(row["handler_errors"])
    )


def _beyond(wrong_s: float) -> float:
    return max(wrong_s - 1.0, 0.0)


def worst(rows: Sequence[Row], count: int = WORST) -> list[Row]:
    """The worst flights, the worst first; those with next to nothing wrong are left out."""
    ordered = sorted(rows, key=lambda row: (-badness(row), row["seed"]))
    return [row for row in ordered[:count] if badness(row) >= 1.0]


def summary(rows: Sequence[Row]) -> Row:
    """The figures of all flights."""
    scored = [row for row in rows if "heading_deg" in row]
    calm_h = sum(row["calm_h"] for row in scored)
    faults = [fault for row in scored for fault in row["faults"]]
    accusations = [one for row in scored for one in row["false_accusations"]]
    alarms = [one for row in scored for one in row["false_alarms"]]
    return {
        "flights": len(rows),
        "without_attitude": len(rows) - len(scored),
        "hours": sum(row["length_s"] for row in rows) / 3600.0,
        "hours_without_fault": calm_h,
        "handler_errors": sum(row["handler_errors"] for row in rows),
        "errors_deg": {
            f"{name}_{p}": _percentiles([row[f"{name}_deg"][p] for row in scored])
            for name in ("heading", "tilt")
            for p in ("p50", "p95", "p100")
        },
        **{
            f"{name}_wrong_over_{LONG_S:g}_s": sum(
                row[f"{name}_wrong_s"] > LONG_S for row in scored
            )
            for name in ("heading", "tilt")
        },
        "nees": {
            name: _nees([row[f"nees_{name}"] for row in scored]) for name in ("tilt", "heading")
        },
        "false_accusations": len(accusations),
        "false_accusations_per_100_h": _per(100.0 * len(accusations), calm_h),
        "false_accusations_by_kind": _counted(accusations),
        "false_alarms": len(alarms),
        "false_alarms_per_100_h": _per(100.0 * len(alarms), calm_h),
        "false_alarms_by_kind": _counted(alarms),
        "faults": _outcomes(faults),
        "faults_that_show": _outcomes([fault for fault in faults if fault["shows"]]),
        "by_fault": {
            name: _outcomes([fault for fault in faults if fault["fault"] == name])
            for name in sorted({fault["fault"] for fault in faults})
        },
        "cpu_s": sum(row["cpu_s"] for row in rows),
    }


def _percentiles(values: Sequence[float | None]) -> Row:
    """Of one figure over all flights: the median, the 95th percentile, the worst."""
    known = sorted(value for value in values if value is not None)
    if not known:
        return {"p50": None, "p95": None, "p100": None}
    return {
        "p50": median(known),
        "p95": known[min(int(0.95 * len(known)), len(known) - 1)],
        "p100": known[-1],
    }


def _nees(values: Sequence[float | None]) -> Row:
    known = [value for value in values if value is not None]
    low, high = HONEST
    return {
        "median": median(known) if known else None,
        "flights": len(known),
        "below": sum(value < low for value in known),
        "above": sum(value > high for value in known),
    }


def _per(count: float, hours: float) -> float | None:
    return count / hours if hours > 0.0 else None


def _counted(reports: Sequence[Row]) -> dict[str, int]:
    return dict(Counter(report["kind"] for report in reports).most_common())


def _outcomes(faults: Sequence[Row]) -> Row:
    """How many faults ended how; ``accused``: with a sound part named meanwhile."""
    found = Counter(fault["outcome"] for fault in faults)
    told = len(faults) - found["missed"]
    return {
        "count": len(faults),
        **{outcome: found[outcome] for outcome in OUTCOMES},
        "accused": sum(bool(fault["accused"]) for fault in faults),
        "told_share": told / len(faults) if faults else None,
        "named_share": (found["right"] + found["late"]) / len(faults) if faults else None,
    }


def table(document: Row, replay: Callable[[int], str]) -> str:
    """The campaign for people.

    Args:
        document: ``summary`` and ``worst``.
        replay: the command that flies a seed again.
    """
    found = document["summary"]
    lines = [
        f"{found['flights']} flights, {found['hours']:.1f} h, "
        f"{found['hours_without_fault']:.1f} h of them without a fault",
        "",
        f"{'over all flights':28}{'median':>8}{'95 %':>8}{'worst':>8}",
    ]
    for name, values in found["errors_deg"].items():
        cells = "".join(_cell(values[p]) for p in ("p50", "p95", "p100"))
        error, p = name.split("_")
        lines.append(f"{f'{error}, deg, {WORDS[p]} of a flight':28}{cells}")
    lines += [
        "",
        f"wrong for more than {LONG_S:g} s while a sensor shows better: heading in "
        f"{found['heading_wrong_over_10_s']} flights, tilt in {found['tilt_wrong_over_10_s']}",
        *(
            f"NEES of {name}: median {_cell(nees['median']).strip()}, below {HONEST[0]:g} in "
            f"{nees['below']} flights, above {HONEST[1]:g} in {nees['above']}, of {nees['flights']}"
            for name, nees in found["nees"].items()
        ),
        *(
            f"{words}: {found[key]} ({_cell(found[f'{key}_per_100_h']).strip()} in 100 h) "
            + ", ".join(f"{kind} {n}" for kind, n in found[f"{key}_by_kind"].items())
            for key, words in (
                ("false_accusations", "false accusations"),
                ("false_alarms", "false alarms"),
            )
        ),
        "",
        *_fault_lines(found),
        "",
        *(f"{badness(row):8.0f}  {_reasons(row)}\n          {replay(row['seed'])}"
          for row in document["worst"]),
    ]  # fmt: skip
    return "\n".join(lines) + "\n"


WORDS = {"p50": "median", "p95": "95 %", "p100": "worst"}


def _cell(value: float | None) -> str:
    return f"{'-':>8}" if value is None else f"{value:8.2f}"


def _fault_lines(found: Row) -> list[str]:
    headings = ("count", *OUTCOMES, "accused")
    lines = [f"{'fault':20}" + "".join(f"{heading:>10}" for heading in headings)]
    whole = {"all": found["faults"], "all that show": found["faults_that_show"]}
    for name, row in {**found["by_fault"], **whole}.items():
        lines.append(f"{name:20}" + "".join(f"{row[heading]:>10}" for heading in headings))
    return lines


def _reasons(row: Row) -> str:
    """Why a flight is among the worst."""
    if "heading_deg" not in row:
        return "no attitude at all"
    reasons = [
        f"{name} wrong for {row[f'{name}_wrong_s']:.0f} s at {row[f'{name}_wrong_at_s']:.0f} s"
        for name in ("heading", "tilt")
        if row[f"{name}_wrong_s"] > 1.0
    ]
    reasons += [
        f"{f['fault']} {f['outcome']}" for f in row["faults"] if f["outcome"] in OUTCOMES[3:]
    ]
    for key, words in (("false_accusations", "accused"), ("false_alarms", "alarm")):
        reasons += [f"{words}: {one['text']} ({one['told_s']:.0f} s)" for one in row[key][:3]]
    return "; ".join(reasons) or "an exception in the service"
