"""Memory, parameters and samples of the flight filter in integers, and the ranges they keep.

It is the default filter (docs/filter.md) in 32-bit integers. The frame n is north-east-down with
true north. Units: velocity over gravity in s, Q24; theta in units of BIAS_UNIT = 2e6 / 2^27 rad/s
(bias, three) and 0.5 rad (heading). Logarithms are to base two, Q8. Formats: docs/fixed-point.md.
"""

from h2nav.attitude.kernels.fixed_motion import (
    BIAS_LIMIT,
    CORRECTION_LIMIT,
    MOST_DT_US,
    RATE_LIMIT,
)
from h2nav.attitude.kernels.fixed_triad import Q_LIMIT

# state; the attitude, the bias and the turn to come stand in fixed_motion
E_N, E_E, E_D = range(7, 10)  # correction to come about north, east, down; half radians, Q30
AGE_US = 13  # time since the start of the tilt; -1: not aligned
SATURATIONS = 14  # samples in which a limit was met
S_N, S_E = range(15, 17)  # velocity north, east
U_N = 17  # 4: sensitivity of the tilt north to theta, rad, Q28
U_E = 21  # 4: ... of the tilt east
V_N = 25  # 4: sensitivity of the velocity north to theta, s, Q24
V_E = 29  # 4: ... of the velocity east
P = 33  # 10: covariance of theta, Q28: 00, 01, 02, 03, 11, 12, 13, 22, 23, 33
D = 43  # 4: correction of theta that the frame has found, Q28
PHASE = 47  # which part of the second stage runs with this sample
FRAME_US = 48  # time of the frame so far
SUM_N, SUM_E = range(49, 51)  # mean innovation of the frame so far
SUM_TURN = 51  # mean squared rate of the frame so far
T_FRAME = 52  # time of the frame before, s, Q17
Y_N, Y_E = range(53, 55)  # innovation that the second stage works on
USE = 55  # 0: none, 1: bounded velocity, 2: a fix
LOG_NOISE = 56  # of that innovation, s^2
LOG_GYRO = 57  # of the gyro's noise with rotation, rad^2/s
LOG_VELOCITY = 58  # of the velocity noise as last used, s^2/Hz
LOG_EASE = 59  # of the factor on all noises while the filter starts
KT_M, KT_S = range(60, 62)  # gain in use per frame or at a fix: tilt, M 2^-(15 + S) 1/s
KV_M, KV_S = range(62, 64)  # ... velocity, M 2^-(15 + S)
SET = 64  # number of the gain set in use
TURNING = 65  # level of rotation, units of TURN_UNIT
MOVING = 66  # level of the innovation, s^2, Q24
SHAKING = 67  # the same about its slow mean
DRIFT_N, DRIFT_E = range(68, 70)  # slow mean of the innovation
A_N, A_E = range(70, 72)  # what rounding has left of the acceleration
F_X, F_Y, F_Z = range(72, 75)  # ... of the specific force
LP_RATE = 75  # 3: low-passed rate, half radians per microsecond, Q44
LP_FORCE = 78  # 3: low-passed specific force over gravity, Q24
STEADY_US = 81  # how long both have been steady
REST_US = 82  # how long without anything that contradicts rest
UNSTEADY = 83  # -1: one sample of the frame was not steady
REST_AXIS = 84  # which axis of the bias is measured next
LOST = 85  # angle that the clipped samples in a row may have hidden, rad, Q28
DOUBT = 86  # deviation of the tilt beyond that of the gain sets, rad, Q28
DENIED = 87  # 1: fixes deny the tilt by far: the force is asked; 2: the force denies it too
AIDED = 88  # 1: a velocity from outside holds the filter
MISSES = 89  # fixes refused in a row
C_N, C_E = range(90, 92)  # velocity gained since aiding began, modulo 2^28
FIX_Y_N, FIX_Y_E = range(92, 94)  # innovation of a fix that waits for its frame
FIX_VAR = 94  # its variance, s^2, Q24
FIX_US = 95  # time since the fix before; 0: none waits
FIELD = 96  # 3: the field that came last
FIELD_US = 99  # time since it came
FIELD_AGE_US = 100  # time that the field in M stands for; 0: no new one
M = 101  # 3: field in n, Q14
M_RATE = 104  # 3: its change by rotation, 2^14 / 2^14 in 1e6 2^-28 1/s
FLAT, NORM = range(107, 109)  # its horizontal part and its length, Q14
HEADING = 109  # its direction from north, rad, Q28
BELIEVED = 110  # 1: it agrees with its reference; 2: the heading is ready to be measured
NO_FIELD = 111  # 0: a field has been believed; 1: none yet; 2: the next gives the heading
REF_FLAT, REF_DOWN, REF_NORM = range(112, 115)  # reference of the field, Q26; norm 0: none yet
REF_GIVEN = 115  # 1: it comes from a model of the earth's field
NEW_FLAT, NEW_DOWN, NEW_NORM = range(116, 119)  # a field that contradicts it, but not itself
NEW_US = 119  # for how long
NEW_TURN = 120  # over how much turning, rad, Q16
MAGNETIC = 121  # level of magnetic disturbance, rad^2, Q26
LAG_NUM, LAG_DEN = range(122, 124)  # sums that give the latency of the field's samples
LAG = 124  # latency in use, 8 us
SEEN_US = 125  # time that the field of this frame stands for; 0: there is none
ROW = 126  # 4: how the heading depends on theta, rad, Q28
ERROR = 130  # what the field says of the heading, rad, Q28
LOG_HEADING = 131  # of its variance
GAIN_H = 132  # 4: covariance of theta with the measurement, scaled to 15 digits
GAIN_INVERSE = 136  # one over its variance, scaled
GAIN_E = 137  # innovation over variance, scaled
GAIN_D_SHIFT, GAIN_P_SHIFT = range(138, 140)  # what their products are divided by
FIX_SPAN_US = 140  # time since the fix before, of the one in use
DUE = 141  # E_D as if nothing had been turned since the field in M came
DECLINATION = 142  # rad, Q28
SIN_DECLINATION, COS_DECLINATION = range(143, 145)  # Q14
STATE_SIZE = 145

# parameters
LP_SHIFT = 0  # the low-pass takes 2^-shift of the difference
REST_RATE, REST_FORCE = range(1, 3)  # squared limits about the low-passed signals
T_REST_US = 3
LOG_REST = 4  # noise density of the low-passed rate squared, units^2 s
BIAS_MOST = 5  # the bias is never larger, Q53
BIAS_VAR = 6  # start and most of the bias variance, Q28
BIAS_WALK = 7  # units^2 per s, Q28
HEADING_VAR = 8
GYRO = 9  # rad^2/s, Q33
SCALE_M, SCALE_S = range(10, 12)  # gyro scale noise: M 2^-(15 + S) per unit of TURNING
HEADING_M, HEADING_S = range(12, 14)  # the same about the vertical
FLOOR, CORRELATION, CEILING = range(14, 17)  # s^2/Hz Q24, s Q12, s^2/Hz Q24
FIX_FLOOR, FIX_CORRELATION, FIX_CEILING = range(17, 20)
LOG_INFLATE, LOG_FIX_INFLATE = range(20, 22)
LOG_FIX_GATE = 22
IMPOSSIBLE = 23  # squared velocity, Q24
T_LEVEL_US, T_DRIFT_US, T_EASE_US = range(24, 27)
LOG_START = 27  # of the start factor in us
FIELD_VAR = 28  # heading density of the magnetometer, rad^2 s, Q26
FIELD_CORRELATION = 29  # s, Q12
NORM_GATE, DIP_GATE = range(30, 32)  # relative, Q15; sine, Q15
T_REFERENCE_US = 32
T_NEW_US = 33
NEW_TURN_LEAST = 34  # rad, Q16
LAG_PRIOR = 35  # in units of LAG_DEN for a field of Q14 norm one
LAG_MOST = 36  # units of 8 us
LOG_BOUNDS = 37  # 11: omega0^4 up to which a set is taken
SETS = 12
K_TILT = LOG_BOUNDS + SETS - 1  # 12: 1/s^2, packed
K_VELOCITY = K_TILT + SETS  # 12: 1/s, packed
PERIODS = 4
FIX_PERIODS_US = K_VELOCITY + SETS  # 4: longest period served
K_FIX_TILT = FIX_PERIODS_US + PERIODS  # 4 x 12: 1/s, packed
K_FIX_VELOCITY = K_FIX_TILT + PERIODS * SETS  # 4 x 12, packed
PARAMS_SIZE = K_FIX_VELOCITY + PERIODS * SETS

# sample; the rate and the time stand in fixed_motion
A_X, A_Y, A_Z = range(3, 6)  # specific force over gravity, Q20
F_FIELD = 6  # 3: field, Q14 = 64 uT
HAS_FIELD = 9
CLIPPED = 11  # 1: the rate counts, the force and the field do not
REST = 12  # 0: not at rest, 1: the signals decide, 2: on the ground, as the autopilot says
NOSE = 13  # velocity along the nose over gravity, s, Q11
IS_AIDED = 14  # 1: velocity fixes come
HAS_FIX = 15  # 1: one comes with this sample
FIX_V = 16  # 2: velocity north, east
FIX_C = 18  # 2: C when the fix was true
FIX_VARIANCE = 20  # s^2, Q24
FIX_PERIOD_US = 21  # time since the fix before
SAMPLE_SIZE = 22

# bits of the result
FORCE_USED = 1
FIELD_USED = 2
RESTING = 4
VELOCITY_USED = 8
RESTARTED = 16
SATURATED = 32
ALIGNED = 64  # this sample has given a first attitude

FRAME = 16  # samples per frame of the second stage
E_MOST = 1 << 30
S_MOST = 1 << 29  # 32 s: 313 m/s
U_MOST = (1 << 30) - 1
V_MOST = (1 << 30) - 1
P_MOST = (1 << 30) - 1
P_LEAST = 256  # variances stay positive
Y_MOST = 1 << 27  # 8 s: 78 m/s
LEVEL_MOST = 1 << 29
DOUBT_MOST = 421439783  # 1.57 rad: nothing is known
FORCE_MOST = 16 << 20
AGE_MOST_US = 1 << 30
FRAME_MOST_US = 240000
C_MASK = (1 << 28) - 1
MOST_MISSES = 5
LOG_MOST = 10240
FIELD_MOST_US = 1000000  # a sample never counts for more than this time
NORM_MOST = 60000
REF_MOST = NORM_MOST << 12
D_MOST = (1 << 30) - 1
PACKED_MOST = (32767 << 5) + 31

STATE_RANGES = (
    *(((-Q_LIMIT, Q_LIMIT),) * 4),
    *(((-BIAS_LIMIT, BIAS_LIMIT),) * 3),
    *(((-E_MOST, E_MOST),) * 3),
    *(((-CORRECTION_LIMIT, CORRECTION_LIMIT),) * 3),
    (-1, AGE_MOST_US),
    (0, 1 << 30),
    *(((-S_MOST, S_MOST),) * 2),
    *(((-U_MOST, U_MOST),) * 8),
    *(((-V_MOST, V_MOST),) * 8),
    (P_LEAST, P_MOST),
    *(((-P_MOST, P_MOST),) * 3),
    (P_LEAST, P_MOST),
    *(((-P_MOST, P_MOST),) * 2),
    (P_LEAST, P_MOST),
    (-P_MOST, P_MOST),
    (P_LEAST, P_MOST),
    *(((-D_MOST, D_MOST),) * 4),
    (0, FRAME - 1),
    (0, FRAME_MOST_US),
    *(((-Y_MOST, Y_MOST),) * 2),
    (0, 1 << 30),
    (0, 32767),
    *(((-D_MOST, D_MOST),) * 2),
    (0, 2),
    *(((-LOG_MOST, LOG_MOST),) * 4),
    (0, 32767),
    (-3, 30),
    (0, 32767),
    (-3, 30),
    (0, SETS - 1),
    *(((0, LEVEL_MOST),) * 3),
    *(((-Y_MOST, Y_MOST),) * 2),
    *(((0, 8191),) * 2),
    *(((0, 511),) * 3),
    *(((-(RATE_LIMIT << 4), RATE_LIMIT << 4),) * 3),
    *(((-(FORCE_MOST << 4), FORCE_MOST << 4),) * 3),
    *(((0, AGE_MOST_US),) * 2),
    (-1, 0),
    (0, 2),
    (0, 1 << 30),
    (0, DOUBT_MOST),
    (0, 2),
    (0, 1),
    (0, MOST_MISSES),
    *(((0, C_MASK),) * 2),
    *(((-D_MOST, D_MOST),) * 2),
    (0, 1 << 24),
    (0, 1 << 22),
    *(((-32768, 32767),) * 3),
    *(((0, FIELD_MOST_US),) * 2),
    *(((-NORM_MOST, NORM_MOST),) * 3),
    *(((-32767, 32767),) * 3),
    *(((0, NORM_MOST),) * 2),
    (-(1 << 30), 1 << 30),
    (0, 2),
    (0, 2),
    (0, REF_MOST),
    (-REF_MOST, REF_MOST),
    (0, REF_MOST),
    (0, 1),
    (0, REF_MOST),
    (-REF_MOST, REF_MOST),
    (0, REF_MOST),
    (0, AGE_MOST_US),
    (0, 1 << 30),
    (0, 1 << 26),
    (-(1 << 30), 1 << 30),
    (0, 1 << 30),
    (0, 12500),
    (0, FIELD_MOST_US),
    *(((-U_MOST, U_MOST),) * 4),
    (-D_MOST, D_MOST),
    (-LOG_MOST, LOG_MOST),
    *(((-32768, 32767),) * 4),
    (0, 32768),
    (-32768, 32768),
    *(((0, 31),) * 2),
    (0, 1 << 22),
    (-E_MOST, E_MOST),
    (1 - (1 << 30), (1 << 30) - 1),
    *(((-(1 << 14), 1 << 14),) * 2),
)
PARAMS_RANGES = (
    (0, 14),
    *(((0, 1 << 30),) * 2),
    (0, AGE_MOST_US),
    (-LOG_MOST, LOG_MOST),
    (1, BIAS_LIMIT),
    (P_LEAST, P_MOST),
    (0, 1 << 28),
    (P_LEAST, P_MOST),
    (1, 1 << 28),
    (0, 32767),
    (0, 31),
    (0, 32767),
    (0, 31),
    *(((1, 1 << 28), (0, 32767), (1, 1 << 30)) * 2),
    *(((0, LOG_MOST),) * 3),
    (1, 1 << 30),
    *(((1000, 1 << 29),) * 2),
    (0, 1 << 29),
    (-LOG_MOST, LOG_MOST),
    (1, 1 << 26),
    (0, 32767),
    *(((0, 32767),) * 2),
    *(((1000, 1 << 29),) * 2),
    (0, 1 << 30),
    (1, 1 << 29),
    (0, 12500),
    *(((-LOG_MOST, LOG_MOST),) * 11),
    *(((0, PACKED_MOST),) * 24),
    *(((0, 1 << 22),) * 4),
    *(((0, PACKED_MOST),) * 96),
)
SAMPLE_RANGES = (
    *(((-(1 << 31), (1 << 31) - 1),) * 3),
    *(((-FORCE_MOST, FORCE_MOST - 1),) * 3),
    *(((-32768, 32767),) * 3),
    (0, 1),
    (0, MOST_DT_US),
    (0, 1),
    (0, 2),
    (-32767, 32767),
    *(((0, 1),) * 2),
    *(((-S_MOST, S_MOST),) * 2),
    *(((0, C_MASK),) * 2),
    (1, 1 << 24),
    (1, 1 << 22),
)
