"""Smoothed estimates of a recording, from the inputs that a `Listener` recorded."""

import functools
import itertools
from collections.abc import Callable, Iterator
from typing import NamedTuple

from h2nav.attitude import smoothing
from h2nav.attitude.filter import AttitudeFilter
from h2nav.attitude.samples import AttitudeEstimate, ImuSample
from h2nav.attitude.smoothing import Given
from h2nav.maths import quaternion
from h2nav.maths.units import DEG
from h2nav.recordings.listener import Listener, Stretch
from h2nav.service.autopilot import Identity


class SmoothedRecord(NamedTuple):
    """One smoothed attitude, made from the whole recording; body to NED.

    Attributes:
        t_us: autopilot time of its sample.
        q_w: attitude quaternion, Hamilton, scalar first.
        roll_deg: Euler angles of the z-y-x sequence.
        bias_x_rad_s: gyro bias, body frame.
        sigma_tilt_deg: predicted one-sigma tilt error; empty where the filter has no figure.
        sigma_heading_deg: predicted one-sigma heading error; the same.
    """

    t_us: int
    q_w: float
    q_x: float
    q_y: float
    q_z: float
    roll_deg: float
    pitch_deg: float
    yaw_deg: float
    bias_x_rad_s: float
    bias_y_rad_s: float
    bias_z_rad_s: float
    sigma_tilt_deg: float
    sigma_heading_deg: float


def smoothed_record(estimate: AttitudeEstimate) -> SmoothedRecord:
    """Flattens an estimate and adds its Euler angles for plots."""
    roll, pitch, yaw = quaternion.to_euler(estimate.q_nb)
    return SmoothedRecord(
        estimate.t_us,
        *estimate.q_nb,
        roll / DEG,
        pitch / DEG,
        yaw / DEG,
        *estimate.bias_b,
        estimate.sigma_tilt_rad / DEG,
        estimate.sigma_heading_rad / DEG,
    )


def smoothed(
    listener: Listener,
    filter_for: Callable[[Identity], AttitudeFilter],
    *,
    with_field: bool = True,
    left_out: Callable[[int], object] = lambda count: None,
) -> Iterator[tuple[int, AttitudeEstimate]]:
    """Yields host time of arrival (ns) and smoothed attitude of each sample that has one.

    Args:
        filter_for: creates the filter of a vehicle.
        with_field: False removes the compass.
        left_out: takes the number of samples of each piece whose arithmetic failed.
    """
    for identity, group in itertools.groupby(listener.stretches, lambda each: each.identity):
        if identity is None:
            continue
        stretches = list(group)
        given = (Given(_samples(stretch, with_field), stretch.inputs) for stretch in stretches)
        arrived_us = itertools.chain.from_iterable(each.arrived_us for each in stretches)
        found = smoothing.smoothed(given, functools.partial(filter_for, identity), left_out)
        for at_us, estimate in zip(arrived_us, found, strict=True):
            if estimate is not None:
                yield 1000 * at_us, estimate


def _samples(stretch: Stretch, with_field: bool) -> list[ImuSample]:
    if with_field:
        return stretch.samples
    return [sample._replace(m_b_ut=None) for sample in stretch.samples]
