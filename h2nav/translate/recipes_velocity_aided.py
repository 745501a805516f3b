"""What of the velocity-aided filter is derived: float function, what it writes, formats beside it.

The schedule of the integers is in here, too: they run the second stage once per frame, and one
float function in several parts. The formats of the state are declared where the state is
(`velocity_aided/memory.py`), those of parameters in `velocity_aided/parameters.py`; here are those
of arguments and local variables.

Source: docs/design/007-one-kernel.md.
"""

from collections.abc import Mapping

from h2nav.attitude.record import Form, Grid, grids_of, row, rows
from h2nav.attitude.velocity_aided import memory as floats
from h2nav.attitude.velocity_aided.integer import memory as integers
from h2nav.attitude.velocity_aided.parameters import PARAMETERS, Fixed, Scaled
from h2nav.attitude.velocity_aided.units import (
    BIAS_UNIT_RAD_S,
    FIELD_RATE_UNIT,
    HEADING_UNIT_RAD,
    LAG_DEN_UNIT,
    LAG_NUM_UNIT,
    LAG_UNIT_S,
    TURN_UNIT,
)
from h2nav.translate.derivation import Operand, Recipe

_STATE, _GAINS, _ROTATION = "s: State", "g: Gains", "r: list[I32]"
# steps of fields that the integers name or scale in their own way
_OWN_STEPS = {"turning": TURN_UNIT, "gyro_jitter": 2.0**-36}
# the integers' level of jitter has the share in it
_JITTER = {"g.jitter_share": 1.0}


def _grid(form: Form, *, saturates: bool = False) -> Grid:
    return grids_of(form, saturates=saturates)[0]


def _own(name: str, step: float) -> Operand:
    """A field of the integers' state with its step."""
    found = row(integers.State, name)
    assert found.range is not None
    return Operand(f"s.{name}", (Grid(step, *found.range),))


_R = Operand("r", (Grid(2.0**-15, -32767, 32767),))
_FRAME = {"dt": _own("frame_time", 2.0**-17), "w.r_nb": _R}
# heading per bias over one frame, in units of theta
_TURN = _grid((22, HEADING_UNIT_RAD / BIAS_UNIT_RAD_S, -0.0078125, 0.0078125))
_CARRIED = _grid((28, BIAS_UNIT_RAD_S * HEADING_UNIT_RAD, -2.0, 2.0))
_TURNS = {"dx": _TURN, "dy": _TURN, "dz": _TURN}


_GAINS_IN_USE = {
    "kt": _own("k_tilt_m", 2.0**-15)._replace(fall="s.k_tilt_s", fall_range=(-3, 30)),
    "kv": _own("k_velocity_m", 2.0**-15)._replace(fall="s.k_velocity_s", fall_range=(-3, 30)),
}


def _small_innovation(part: str) -> Operand:
    """An innovation with four bits more; one beyond 2 s counts as 2 s."""
    most = (1 << 25) - 1
    text = f"(limited(s.innovation_{part}, {most}) << 4)"
    return Operand(text, (Grid(2.0**-28, -most << 4, most << 4),))


def _theta_grids() -> tuple[Grid, ...]:
    """Of theta's correction: three biases and the heading."""
    units = (BIAS_UNIT_RAD_S, BIAS_UNIT_RAD_S, BIAS_UNIT_RAD_S, HEADING_UNIT_RAD)
    return grids_of((28, units, -4.0, 4.0))


def fields() -> Mapping[str, Operand]:
    """The integers behind the state and the gains, by their names in the floats."""
    found = {f"s.{one.name}": Operand(f"s.{one.name}", one.grids) for one in rows(floats.State)}
    found = {name: operand for name, operand in found.items() if operand.grids}
    found.update({f"s.{name}": _own(name, step) for name, step in _OWN_STEPS.items()})
    for parameter in PARAMETERS:
        fixed, name = parameter.fixed, f"g.{parameter.field}"
        if isinstance(fixed, Fixed) and fixed.of is None:
            grid = Grid(fixed.per * 2.0**-fixed.q, fixed.low, fixed.high)
            found[name] = Operand(f"g.{fixed.field}", (grid,))
        elif isinstance(fixed, Scaled):
            grid = Grid(fixed.per * 2.0**-15, 0, 32767)
            found[name] = Operand(f"g.{fixed.field}_m", (grid,), f"g.{fixed.field}_s", (0, 31))
    return found


_THETA = Operand("step", _theta_grids())
_VARIANCE = grids_of(floats.BIAS_VARIANCE)
_SUM = _grid(floats.BIAS_SUM, saturates=True)
_US = 1e-6
_PERIOD = Operand("(s.fix_span_us >> 7)", (Grid(128.0 * _US, 0, 32768),))
_SHARE = _grid((15, 1.0, 0.0, 1.0))


def _saturating(name: str, step: float) -> Operand:
    """A field of the integers' state with its step, that stays at the ends of its range."""
    found = _own(name, step)
    return found._replace(grids=tuple(grid._replace(saturates=True) for grid in found.grids))


def _part(name: str, step: float, size: int = 1) -> Operand:
    """An argument that is a part of a field, or of its change."""
    end = size * integers.FIELD_PART_MAX
    return Operand(name, (Grid(step, -end, end),))


_FIELD = 2.0**-14  # 64 uT
# Turn and innovation of the heading are held times the field's horizontal part, so that the weight
# is the time alone; where the floats divide by the reference's norm, the prior is multiplied by it.
_LATENCY = {
    "s.mag_lag_num": _saturating("mag_lag_num", LAG_NUM_UNIT),
    "s.mag_lag_den": _saturating("mag_lag_den", LAG_DEN_UNIT),
    "weight": Operand("weight", (Grid(2.0**14 * _US, 0, 61),)),
}

RECIPES = (
    Recipe(
        "predict_covariance",
        "predict_theta",
        (
            *("s.p_xx", "s.p_yy", "s.p_zz", "s.p_xh", "s.p_yh", "s.p_zh"),
            "s.heading_variance",
        ),
        (_STATE, _GAINS, _ROTATION),
        _FRAME,
        {**_TURNS, "c0": _CARRIED, "c1": _CARRIED, "c2": _CARRIED},
        _JITTER,
    ),
    Recipe(
        "predict_sensitivities",
        "predict_theta",
        ("s.dvelocity_n", "s.dvelocity_e", "s.dtilt_n", "s.dtilt_e"),
        (_STATE, _ROTATION),
        _FRAME,
        _TURNS,
    ),
    Recipe(
        "predict_shared",
        "predict_shared",
        ("s.p_accel_x", "s.p_accel_y", "s.p_accel", "s.fix_lag_variance"),
        (_STATE, _GAINS, _ROTATION),
        _FRAME,
        _TURNS,
    ),
    Recipe(
        "predict_accel",
        "predict_accel",
        ("s.dvelocity_accel_n", "s.dvelocity_accel_e", "s.dvelocity_lag"),
        (_STATE, _ROTATION),
        _FRAME,
    ),
    Recipe(
        "fade_theta",
        "use_constant_gain",
        ("s.dtilt_n", "s.dtilt_e", "s.dvelocity_n", "s.dvelocity_e"),
        (_STATE,),
        _GAINS_IN_USE,
    ),
    Recipe(
        "fade_aiding",
        "use_gains",
        (
            *("s.dtilt_accel_n", "s.dtilt_accel_e", "s.dvelocity_accel_n", "s.dvelocity_accel_e"),
            *("s.dtilt_lag", "s.dvelocity_lag"),
        ),
        (_STATE,),
        {
            **_GAINS_IN_USE,
            "accel_n": _own("accel_n", 2.0**-13),
            "accel_e": _own("accel_e", 2.0**-13),
        },
        {"part": _grid(floats.BY_LAG, saturates=True)},
    ),
    Recipe(
        "level_sensitivities",
        "level_sensitivities",
        ("s.dtilt_accel_n", "s.dtilt_accel_e", "s.dtilt_lag"),
        (_STATE, _ROTATION),
        {"w.r_nb": _R},
    ),
    Recipe(
        "forget_velocity",
        "forget_velocity",
        (
            *("s.dvelocity_n", "s.dvelocity_e", "s.dvelocity_accel_n", "s.dvelocity_accel_e"),
            *("s.dvelocity_lag", "s.unused_variance"),
        ),
        (_STATE,),
    ),
    Recipe(
        "begin_bias",
        "begin_bias",
        (
            "s.p_accel_x",
            "s.p_accel_y",
            "s.bias_moved",
            "s.bias_trend",
            "s.bias_expected",
            "s.bias_usual",
            "s.bias_walk",
        ),
        (_STATE,),
    ),
    Recipe(
        "follow_bias",
        "follow_bias",
        ("s.bias_moved", "s.bias_expected"),
        (_STATE, "step: list[I32]", "before_x: I32", "before_y: I32", "before_z: I32"),
        {
            "w.dtheta": _THETA,
            **{f"before_{axis}": Operand(f"before_{axis}", _VARIANCE) for axis in "xyz"},
        },
    ),
    Recipe(
        "adapt_walk",
        "adapt_walk",
        ("s.bias_moved", "s.bias_trend", "s.bias_expected", "s.bias_usual", "s.bias_walk"),
        (_STATE,),
        {"period": _PERIOD, "s.age_s": _own("age_us", _US)},
        {
            "keep": _SHARE,
            "keep * keep": _SHARE,
            "moved": _SUM,
            "trend": _SUM,
            "usual": _grid(floats.BIAS_SUM_VARIANCE, saturates=True),
            "expected": _grid((28, floats.BIAS_VARIANCE[1], -4.0, 4.0)),
            "walk": _grid((28, floats.BIAS_VARIANCE[1], -2.0, 2.0)),
        },
    ),
    Recipe(
        "match_variance",
        "match_variance",
        ("s.fix_mean_n", "s.fix_mean_e", "s.unused_variance"),
        (_STATE, _GAINS),
        {
            "north": _small_innovation("n"),
            "east": _small_innovation("e"),
            "predicted": _own("fix_predicted", 2.0**-28),
            "period": _PERIOD,
        },
        {
            "square": _grid((27, 1.0, 0.0, 8.0), saturates=True),
            "unused": Grid(2.0**-15, 0, 32768),
        },
    ),
    Recipe(
        "follow_offset",
        "follow_offset",
        ("s.mag_offset_norm", "s.mag_offset_dip", "s.mag_offset_s"),
        (_STATE, "more_norm: I32", "more_dip: I32", "age: I32"),
        {
            "more_norm": Operand("more_norm", (Grid(2.0**-15, -32767, 32767),)),
            "more_dip": Operand("more_dip", (Grid(2.0**-15, -32767, 32767),)),
            "age": Operand("age", (Grid(_US, 1, integers.FIELD_MAX_US),)),
            "s.mag_ref_given": _own("mag_ref_given", 1.0),
        },
        {"time": _grid(floats.OFFSET_SPAN)},
    ),
    Recipe(
        "learn_from_parts",
        "learn_from_parts",
        ("s.mag_lag_num", "s.mag_lag_den"),
        (
            *(_STATE, "weight: I32", "down: I32", "down_rate: I32", "level: I32"),
            "flat_rate: I32",
        ),
        {
            **_LATENCY,
            "down": _part("down", _FIELD),
            "down_rate": _part("down_rate", FIELD_RATE_UNIT),
            "level": _part("level", _FIELD),
            "flat_rate": _part("flat_rate", FIELD_RATE_UNIT),
        },
    ),
    Recipe(
        "follow_turns",
        "follow_turns",
        ("s.mag_turn", "s.mag_turn_error"),
        (_STATE, "turn: I32", "error: I32", "age: I32"),
        {
            "s.mag_turn": _saturating("mag_turn", FIELD_RATE_UNIT * 2.0**-8),
            "s.mag_turn_error": _saturating("mag_turn_error", _FIELD * 2.0**-8),
            "turn": _part("turn", FIELD_RATE_UNIT),
            "error": _part("error", _FIELD),
            "age": Operand("age", (Grid(_US, 0, integers.FIELD_MAX_US),)),
        },
    ),
    Recipe(
        "learn_from_turn",
        "learn_from_turn",
        ("s.mag_lag_num", "s.mag_lag_den"),
        (_STATE, "weight: I32", "turn: I32", "error: I32"),
        {
            **_LATENCY,
            "turn": _part("turn", FIELD_RATE_UNIT),
            "error": _part("error", _FIELD),
            "lag": _own("mag_lag", LAG_UNIT_S),
        },
        {"lag * turn - error": _part("", _FIELD, 2).grids[0]._replace(saturates=True)},
    ),
)
