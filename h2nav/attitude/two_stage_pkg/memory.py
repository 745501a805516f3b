"""Names of the places in the two-stage filter's arrays, in the translatable subset.

`x` is the filter's memory, `g` its gains and limits, `z` one sample. The frame is magnetic NED: x
north of the compass, z down. Angles are rad, rates rad/s, forces m/s^2, fields microtesla, times s.

Equations: docs/derivation.md section 3.
"""

# --- x: memory ---
X_Q = 0  # 4: attitude, body to magnetic NED, scalar first
X_BIAS = 4  # 3: gyro bias
X_U = 7  # 9: regressor, row by row: attitude error = -U (bias error)
X_P = 16  # 6: bias covariance: 00, 01, 02, 11, 12, 22
X_RES = 22  # 2: low-passed horizontal force, north and east
X_JITTER = 24  # variance of the horizontal force about its low-pass
X_LEVEL = 25  # low-passed square of X_RES: how much the vehicle accelerates
X_T_RUN = 26  # time since alignment
X_T_MOVING = 27  # time for which the gain level has not been 0
X_T_NO_FIELD = 28  # time since a field sample was believed
X_HEADING = 29  # 1: the heading is tied to north, 0: to nothing
X_T_WRONG = 30  # time for which both sensors have contradicted the attitude
X_SUM_FORCE = 31  # 3: sum of -force in NED over that time
X_SUM_FIELD = 34  # 3: sum of the field in NED over that time
X_T_FIELD_AGE = 37  # time since the last field sample, believed or not
X_CONVERGED = 38  # 1 after the start-up transient
X_RATE = 39  # 3: gyro sample before this one
X_VAR = 42  # 4: covariance of the bias-free attitude error: nn, ee, dd, nd
X_T_TURNED = 46  # time for which a sane field has contradicted nothing but the heading
X_T_CLIPPED = 47  # time since the last sample that was not clipped
X_MEAN = 48  # 2: slow mean of X_RES: tilt error, not acceleration
X_AGE = 50  # time over which X_LEVEL has been averaged
X_BIAS_0 = 51  # 3: bias at the start
X_P_0 = 54  # 6: its covariance
X_POWER = 60  # as X_LEVEL, without its cap
X_BLIND = 61  # 1: started in motion; the bias has never been learnt at rest
X_T_DOUBT = 62  # time for which either sensor may call the attitude wrong
X_SIZE = 63
# results that are not memory
X_R = 63  # 9: attitude matrix before the correction, row by row
X_F = 72  # 3: -force in NED
X_M = 75  # 3: field in NED
X_ZETA = 78  # 3: weighted innovation
X_INFO = 81  # 4: its information: nn, ee, dd, nd
X_SHARE = 85  # force's honest weight as a share of its level's
X_SHARE_D = 86  # the same of the heading, whose field is seen from the force's tilt
X_APART = 87  # 1: force corrects only tilt and field only heading
X_HELD = 88  # 1: the field's innovation was cut and teaches no bias
X_FROZEN = 89  # 1: the force's innovation is too steady and teaches no bias
X_OFF = 90  # microtesla: how far the field is from the reference
X_TOTAL = 91

# --- z: sample ---
Z_DT = 0
Z_RATE = 1
Z_FORCE = 4
Z_FIELD = 7
Z_HAS_FIELD = 10
Z_CLIPPED = 11
Z_SIZE = 12

# --- g: gains and limits ---
G_DT = 0  # nominal step
G_GRAVITY = 1
G_FIELD_N = 2  # reference field, north and down
G_FIELD_D = 3
G_FORCE_INFO = 4  # 1 / variance of one force sample
G_FIELD_INFO = 5  # 1 / variance of one field sample
G_BIAS_WALK = 6  # variance per second
G_MEAN_RATE = 7  # 1: gyro samples are means over the step before them; 0: instants
G_FORCE_GATE = 8  # m/s^2
G_FIELD_GATE = 9  # microtesla
G_NORM_SHARE = 10  # tolerated relative deviation of a norm
G_DIP_SHARE = 11  # tolerated deviation of the sine of the angle between force and field
G_T_RESIDUAL = 12  # time constants
G_T_LEVEL = 13
G_T_CONVERGE = 14
G_T_HOLD = 15  # a moving vehicle's force outside the gate is ignored for so long
G_T_TURNED = 16  # a sane field outside the gate sets the heading after so long
G_T_WRONG = 17
G_BIAS_STEP = 18  # limits of one bias step and of the bias
G_BIAS_LIMIT = 19
G_LEVEL_CAP = 20  # (m/s^2)^2
G_T_HEADING_LOST = 21  # a heading without field for so long is none
G_GYRO_WALK = 22  # variance of the attitude per second
G_FIELD_CUT = 23  # microtesla: longest innovation of the field that is taken whole
G_LAST_POWER = 24  # X_LEVEL for which the slowest level's weight is right
G_BIAS_DOUBT = 25  # variance that a contradicted attitude adds to the bias
G_T_MEAN = 26  # s: time constant of X_MEAN
G_T_ALIGN = 27  # s: for so long the field gives only heading: its dip is not known yet
G_T_STILL = 28  # s: a vehicle that has begun at rest has shown it after so long
G_STILL_2 = 29  # (m/s^2)^2: steadier force than this teaches no bias
G_FROZEN_WALK = 30  # variance per second of a bias that is not learnt though it might
G_LEVELS = 31  # then per level: threshold of X_LEVEL, weight, k_nn, k_ee, k_dd, k_nd
LEVELS = 7
LEVEL_SIZE = 6
G_SIZE = 73

# The constant gains serve once no variance is above its fixed point by more than this.
STEADY = 1.02

# Variances of the tilt, rad^2: (1.2 deg)^2 opens the gates again, beyond (30 deg)^2 the linear
# correction means nothing.
OPEN_VARIANCE = 4e-4
LOST_VARIANCE = 0.27

# --- bits of the result ---
FORCE_USED = 1
FIELD_USED = 2
WRONG = 4  # both sensors have contradicted the attitude for too long: align again
SATURATED = 8
MOVED = 32  # the vehicle was in motion when it was thought to start at rest: start again
LOST = 16  # the attitude is unknown after clipped samples: align with this sample
