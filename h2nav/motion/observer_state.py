"""State and counters of the twist observer."""

from enum import StrEnum
from typing import NamedTuple

from h2nav.maths.quaternion import Quat, Vec3
from h2nav.motion.error_figures import Innovations
from h2nav.motion.pose_gate import JumpStreak
from h2nav.motion.rigid_step import RigidState
from h2nav.motion.samples import PoseFrame, PoseSample

# Beyond any vehicle: rad/s; m/s or m/s^2.
MAX_RATE = 200.0
MAX_LINEAR = 1e4


class ObserverEvent(StrEnum):
    """Counted events besides the verdicts on poses."""

    SAMPLE_NOT_FINITE = "sample_not_finite"  # or out of range
    SAMPLE_NOT_LATER = "sample_not_later"
    IMU_GAP = "imu_gap"
    NEW_EPOCH = "new_epoch"
    NEAR_HALF_TURN = "near_half_turn"


class Rates(NamedTuple):
    """A stored IMU sample: linear is velocity or acceleration, depending on the settings."""

    t_us: int
    w_b: Vec3
    linear_b: Vec3

    def is_possible(self) -> bool:
        """Whether all values are finite and plausible (NaN fails every comparison)."""
        wx, wy, wz = self.w_b
        vx, vy, vz = self.linear_b
        return (
            abs(wx) <= MAX_RATE
            and abs(wy) <= MAX_RATE
            and abs(wz) <= MAX_RATE
            and abs(vx) <= MAX_LINEAR
            and abs(vy) <= MAX_LINEAR
            and abs(vz) <= MAX_LINEAR
        )


class Fix(NamedTuple):
    """The last pose that was used."""

    t_us: int  # its time
    p_o: Vec3  # position estimate right after it
    turn: Quat  # rotation in ``o`` from the estimated to the measured attitude
    poses: int  # used since the start, 1 or 2; the second one sets the velocity


class ObserverState(NamedTuple):
    """Everything the observer remembers between two calls."""

    now: RigidState | None
    anchor: RigidState | None
    fix: Fix | None
    bias_w: Vec3
    bias_v: Vec3
    samples: tuple[Rates, ...]
    waiting: tuple[PoseSample, ...]
    rotation: Innovations
    position: Innovations
    streak: JumpStreak
    last_t_us: int | None
    stale_samples: int
    frame: PoseFrame | None
    source_resets: int
    reset_counter: int
    counts: tuple[tuple[str, int], ...]
