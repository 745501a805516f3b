"""Smoothed estimates of a recording, from the inputs that a `Listener` recorded."""

import functools
import itertools
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from h2nav.attitude import smoothing
from h2nav.attitude.batch_driver import BatchSamples, Integers
from h2nav.attitude.filter import AttitudeFilter
from h2nav.attitude.samples import AttitudeEstimate
from h2nav.attitude.smoothing import Given, Smoothed
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
) -> Iterator[tuple[Integers, Smoothed]]:
    """Yields (N,) host times of arrival, us, and the smoothed attitudes of samples that have one.

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
        found = smoothing.smoothed(given, functools.partial(filter_for, identity), left_out)
        for stretch, attitudes in zip(stretches, found, strict=True):
            known = attitudes.is_known
            yield stretch.arrived_us[known], attitudes.at(known)


def _samples(stretch: Stretch, with_field: bool) -> BatchSamples:
    samples = stretch.samples
    if with_field:
        return samples
    return samples._replace(has_field=np.zeros_like(samples.has_field))
