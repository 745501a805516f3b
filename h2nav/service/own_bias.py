"""The gyro bias of a lane whose filter has taken over the state of another lane's filter."""

from h2nav.attitude.filter import AttitudeFilter
from h2nav.attitude.samples import AttitudeEstimate, ImuSample, Vec3
from h2nav.maths.units import SECOND_NS

# A bias counts as known from this long before a fault was detected.
BIAS_NS = 5 * SECOND_NS
NO_OFFSET: Vec3 = (0.0, 0.0, 0.0)


class OwnBias:
    """Corrects the rates by the difference between this gyro's bias and that of the state."""

    def __init__(self) -> None:
        self.differs = False  # the rates have to be corrected
        self._offset = NO_OFFSET
        self._known: list[tuple[int, Vec3]] = []

    def learn(self, t_ns: int, bias_b: Vec3) -> None:
        """Takes the bias of the lane while nothing is wrong, rad/s."""
        self._known.append((t_ns, bias_b))
        while len(self._known) > 1 and self._known[1][0] <= t_ns - BIAS_NS:
            del self._known[0]

    def take_over(self, other: "OwnBias", bias_b: Vec3) -> None:
        """Notes that the filter has the state of another lane, with the bias `bias_b`."""
        self._offset, self.differs = NO_OFFSET, False
        if self._known:
            (x, y, z), (u, v, w) = self._known[0][1], bias_b
            a, b, c = other._offset
            self._offset = (x - u + a, y - v + b, z - w + c)
            self.differs = self._offset != NO_OFFSET

    def shift(self, moved: Vec3) -> None:
        """Notes by how much the gyro's zero has moved since it was known, rad/s."""
        a, b, c = moved
        self._known = [(t_ns, (x + a, y + b, z + c)) for t_ns, (x, y, z) in self._known]

    def update(self, chosen: AttitudeFilter, sample: ImuSample) -> AttitudeEstimate | None:
        """Returns the filter's estimate for a sample, with the bias of this lane's gyro."""
        (x, y, z), (a, b, c) = sample.w_b, self._offset
        filtered = chosen.update(sample._replace(w_b=(x - a, y - b, z - c)))
        if filtered is None:
            return None
        u, v, w = filtered.bias_b
        return filtered._replace(bias_b=(u + a, v + b, w + c))
