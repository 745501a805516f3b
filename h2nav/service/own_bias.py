"""Errors of a lane's sensors that its filter does not hold."""

from h2nav.attitude.filter import AttitudeFilter
from h2nav.attitude.samples import (
    AttitudeEstimate,
    ImuSample,
    SensorCorrection,
    SensorErrors,
    Vec3,
)
from h2nav.maths.units import SECOND_NS

# A bias counts as known from this long before a fault was detected.
BIAS_NS = 5 * SECOND_NS
NO_OFFSET: Vec3 = (0.0, 0.0, 0.0)


class OwnBias:
    """Corrects the samples by them.

    A filter may have the state, and the gyro's bias, of another lane's filter; what a sensor was
    found to be wrong by may be more than a filter's bias can be; and no filter estimates the
    accelerometer's bias along z.

    Attributes:
        differs: the rates have to be corrected.
        pushes: the forces have to be corrected.
        rate_factor: by which the gyro's rates have to be multiplied.
    """

    def __init__(self) -> None:
        self.differs = self.pushes = False
        self.rate_factor = 1.0
        self._offset = NO_OFFSET
        # of the accelerometer, as found in flight and at rest
        self._found = self._resting = self._force = NO_OFFSET
        self._known: list[tuple[int, Vec3]] = []

    def learn(self, t_ns: int, bias_b: Vec3) -> None:
        """Takes the bias of the lane while nothing is wrong, rad/s."""
        self._known.append((t_ns, bias_b))
        while len(self._known) > 1 and self._known[1][0] <= t_ns - BIAS_NS:
            del self._known[0]

    def take_over(self, other: "OwnBias", bias_b: Vec3) -> None:
        """Notes that the filter has the state of another lane, with the bias `bias_b`."""
        self._offset = NO_OFFSET
        if self._known:
            (x, y, z), (u, v, w) = self._known[0][1], bias_b
            a, b, c = other._offset
            self._offset = (x - u + a, y - v + b, z - w + c)
        self._set_differs()

    def shift(self, moved: Vec3) -> None:
        """Notes by how much the gyro's zero has moved since it was known, rad/s."""
        self._known = [(t_ns, _plus(bias_b, moved)) for t_ns, bias_b in self._known]

    def correct(self, found: SensorCorrection, *, is_outvoted: bool = False) -> None:
        """Takes what gyro and accelerometer were found to be wrong by.

        Args:
            is_outvoted: other IMUs show that its gyro is wrong; they show when it is right again,
                and by how much its zero has moved then.
        """
        if not is_outvoted:
            self.shift(found.rate_b)
        self._offset = _plus(self._offset, found.rate_b)
        self._set_differs()
        self._set_force(_plus(self._found, found.force_b), self._resting)

    def scale(self, rate_factor: float) -> None:
        """Takes by what the rates have to be multiplied: 1 of a gyro whose scale is right."""
        self.rate_factor = rate_factor
        self._set_differs()

    def _set_differs(self) -> None:
        self.differs = self._offset != NO_OFFSET or self.rate_factor != 1.0

    @property
    def found_b(self) -> Vec3:
        """By what the accelerometer was found to be wrong in flight, m/s^2."""
        return self._found

    def errors(self, of_filter: SensorErrors) -> SensorErrors:
        """The errors of the lane's sensors by those that its filter knows of."""
        if not self.pushes:
            return of_filter
        return of_filter._replace(force_bias_b=_plus(of_filter.force_bias_b, self._force))

    def rest(self, force_b: Vec3) -> None:
        """Takes the accelerometer's bias by the norm of the force at rest, m/s^2."""
        self._set_force(self._found, force_b)

    def forget_found(self) -> None:
        """Forgets by what the accelerometer was wrong in flight: it is good again."""
        self._set_force(NO_OFFSET, self._resting)

    def forget_force(self) -> None:
        """Forgets the accelerometer's errors: it has been switched on again."""
        self._set_force(NO_OFFSET, NO_OFFSET)

    def _set_force(self, found: Vec3, resting: Vec3) -> None:
        self._found, self._resting, self._force = found, resting, _plus(found, resting)
        self.pushes = self._force != NO_OFFSET

    def felt(self, sample: ImuSample) -> ImuSample:
        """The sample with the force that the accelerometer should have shown, if it has one."""
        t_us, w_b, f_b, m_b_ut, clipped = sample
        if f_b == NO_OFFSET:
            return sample
        (x, y, z), (a, b, c) = f_b, self._force
        # `_replace` costs three times as much, for every sample after a rest.
        return tuple.__new__(ImuSample, (t_us, w_b, (x - a, y - b, z - c), m_b_ut, clipped))

    def update(self, chosen: AttitudeFilter, sample: ImuSample) -> AttitudeEstimate | None:
        """Returns the filter's estimate for a sample, with the bias of this lane's gyro."""
        (x, y, z), (a, b, c), k = sample.w_b, self._offset, self.rate_factor
        filtered = chosen.update(sample._replace(w_b=(k * x - a, k * y - b, k * z - c)))
        if filtered is None:
            return None
        return filtered._replace(bias_b=_plus(filtered.bias_b, self._offset))


def _plus(one: Vec3, other: Vec3) -> Vec3:
    return one[0] + other[0], one[1] + other[1], one[2] + other[2]
