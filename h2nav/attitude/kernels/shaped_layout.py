"""Names of the places in the disturbance-shaped filter's arrays, in the translatable subset.

`x` is the filter's memory, `g` its gains and limits, `z` one sample. Frames: body
forward-right-down, local NED with true north. Angles are rad, rates rad/s, forces m/s^2, fields in
one unit throughout, times s; velocities are divided by g (unit: s).

Equations: docs/filter.md.
"""

# --- x: memory ---
X_Q = 0  # 4: attitude, scalar first
X_BIAS = 4  # 3: gyro bias
X_S = 7  # 2: velocity north, east, over g
X_UN = 9  # 4: sensitivity of the tilt north to theta = (bias error 3, heading error)
X_UE = 13  # 4: ... of the tilt east
X_VN = 17  # 4: sensitivity of the velocity north to theta
X_VE = 21  # 4: ... of the velocity east
X_P = 25  # 10: covariance of theta: 00, 01, 02, 03, 11, 12, 13, 22, 23, 33
X_TURNING = 35  # level of rotation, (rad/s)^2
X_MOVING = 36  # level of the velocity innovation, s^2
X_DRIFT = 37  # 2: slow mean of the velocity innovation
X_SHAKING = 39  # level of the velocity innovation about that mean, s^2
X_NV2 = 40  # velocity noise density over g, squared, as last used
X_KT = 41  # gain in use: tilt, 1/s^2, or 1/s at a fix
X_KV = 42  # gain in use: velocity, 1/s, or a plain number at a fix
X_SET = 43  # number of the gain set in use
X_T_RUN = 44  # time since alignment
X_RATE_LP = 45  # 3: low-passed angular rate
X_FORCE_LP = 48  # 3: low-passed specific force
X_T_REST = 51  # how long both have been steady
X_REF_NORM = 52  # reference of the field's norm, 0: none yet
X_REF_DIP = 53  # reference of its dip
X_REF_GIVEN = 54  # 1: the reference comes from a model of the earth's field
X_NEW_NORM = 55  # a field that contradicts the reference, but perhaps not itself
X_NEW_DIP = 56
X_NEW_T = 57  # for how long
X_NEW_TURN = 58  # over how much turning, rad
X_MAGNETIC = 59  # level of magnetic disturbance, rad^2 of heading
X_LAG_NUM = 60  # sums that give the latency of the field's samples
X_LAG_DEN = 61
X_FIELD_AGE = 62  # time since the last new field
X_FIELD = 63  # 3: that field
X_T_NO_FIELD = 66  # time since a field was believed, < 0: never
X_DECLINATION = 67
X_AIDED = 68  # 1: a velocity from outside holds the filter
X_MISSES = 69  # fixes refused in a row
X_C = 70  # 2: velocity gained since aiding began, over g; nothing corrects it
# results that are not memory
X_EASE = 72  # factor on the noise of the second stage while the filter starts
X_R = 73  # 9: attitude matrix, row by row
X_D = 82  # 4: correction of theta
X_INNOVATION = 86  # 3: rotation applied north, east; heading innovation
X_M = 89  # 3: field in NED
X_ROW = 92  # 4: how a heading depends on theta
# memory again: what is known to be wrong with the tilt
X_DOUBT = 96  # its deviation beyond that of the gain sets, rad
X_LOST = 97  # angle that the clipped samples in a row may have hidden, rad
X_DENIED = 98  # 1: fixes deny the tilt by far: the force is asked
X_T_STEADY = 99  # how long both low-passed signals have been steady, and the rate small
X_SIZE = 100

# --- z: sample ---
Z_DT = 0
Z_RATE = 1
Z_FORCE = 4
Z_FIELD = 7
Z_HAS_FIELD = 10
Z_CLIPPED = 11  # the rate counts, the force and the field do not
Z_REST = 12  # 0: not at rest, 1: the signals decide, 2: on the ground, as the autopilot says
Z_NOSE = 13  # pseudo-velocity along the nose, m/s
Z_AIDED = 14  # 1: velocity fixes come; the zero-velocity pseudo-measurement is off
Z_FIX = 15  # 1: one comes with this sample
Z_FIX_V = 16  # 2: velocity north, east, m/s
Z_FIX_C = 18  # 2: X_C when the fix was true
Z_FIX_VAR = 20  # its variance, (m/s)^2
Z_FIX_DT = 21  # time since the fix before
Z_SIZE = 22

# --- g: gains and limits ---
G_GRAVITY = 0
G_GYRO = 1  # gyro density squared, rad^2/s
G_SCALE = 2  # gyro scale noise squared, s
G_SCALE_HEADING = 3  # the same about the vertical
G_FLOOR = 4  # floor of the velocity density over g, squared
G_CORRELATION = 5  # twice the velocity's correlation time
G_CEILING = 6  # ceiling of the velocity density over g, squared
G_FIX_FLOOR = 7  # the same three when a velocity is measured
G_FIX_CORRELATION = 8
G_FIX_CEILING = 9
G_FIX_GATE = 10  # squared
G_IMPOSSIBLE = 11  # velocity over g, squared
G_T_LEVEL = 12
G_START = 13
G_INFLATE = 14
G_FIX_INFLATE = 15
G_BIAS_VAR = 16  # start and most of the bias variance
G_BIAS_WALK = 17  # rad^2/s^3
G_BIAS_LIMIT = 18
G_HEADING_VAR = 19  # start and most of the heading variance
G_FIELD = 20  # heading density of the magnetometer squared, rad^2 s
G_FIELD_CORRELATION = 21  # twice the correlation time of magnetic disturbance
G_NORM_GATE = 22  # relative
G_DIP_GATE = 23
G_T_REFERENCE = 24
G_T_NEW = 25  # a new reference is taken after this time
G_NEW_TURN = 26  # and this much turning
G_LAG_PRIOR = 27
G_LAG_MOST = 28
G_T_REST_LP = 29
G_REST_RATE = 30  # squared
G_REST_FORCE = 31  # squared
G_T_REST = 32
G_REST_NOISE = 33  # density squared of the low-passed rate at rest
G_T_DRIFT = 34
G_T_EASE = 35
G_SETS = 36  # SETS times: upper bound of omega0^4, k_t, k_v
SETS = 12
SET_SIZE = 3
G_PERIODS = 72  # PERIODS times: longest period served, then SETS times k_t, k_v
PERIODS = 4
PERIOD_SIZE = 25
G_SIZE = 172

# --- bits of the result ---
FORCE_USED = 1
FIELD_USED = 2
REST = 4
VELOCITY_USED = 8
RESTARTED = 16
SATURATED = 32

OLDEST_FIELD = 1.0  # s: a sample never counts for more than this time
REST_SIGMAS_2 = 9.0  # a rate that is this far from the known bias is no bias
REST_FLOOR = 3.0e-6  # (0.1 deg/s)^2
MOST_MISSES = 5  # fixes in a row that contradict the filter and not each other
MOST_LOST = 0.2  # rad: after clipped samples that may have hidden more the tilt starts anew
ALL_LOST = 0.6  # rad: ... and the force is the better guess, even of a vehicle that accelerates
MOST_DOUBT = 1.57  # rad: nothing is known
HEADING_LOST = -2.0  # in X_T_NO_FIELD: the next field gives the heading, whatever its dip
LEVEL_DOUBT = 0.1  # rad: of a tilt taken from the force alone
LEVEL_SIZE = 0.1  # relative, of the force's square: 5 % of g
DENIED_DOUBT = 0.5  # rad: refused fixes that need so large a tilt error to be explained
STARTED = 10.0  # of X_EASE: before, the low-passed force is older than the tilt
AIR_COSINE = 0.87  # 30 deg: a steady turn whose force is within 5 % of g banks by 18 deg
GROUND_COSINE = 0.985  # 10 deg: no steady acceleration on the ground is that large
