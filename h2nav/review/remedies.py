"""What to check or to set for each kind of finding, in flight or of the whole flight."""

REMEDIES: dict[str, str] = {
    # Checks in flight.
    "imu_frozen": "Check the IMU's bus and its supply; do not fly on it. Another IMU has to carry "
    "the vehicle (INS_ENABLE_MASK, EK3_PRIMARY; PX4: CAL_ACCn_PRIO, CAL_GYROn_PRIO).",
    "gyro_frozen": "Check the IMU's bus and its supply; replace the autopilot if it comes back.",
    "accelerometer_frozen": "Check the IMU's bus and its supply; replace the autopilot if it comes "
    "back.",
    "axis_stuck": "One axis of the sensor is dead or at the end of its range: check for vibration "
    "and clipping, then replace the IMU.",
    "compass_frozen": "Check the compass's cable and I2C bus; power-cycle and look whether its "
    "values move.",
    "vibration": "Balance propellers, look for cracks and loose parts, mount the autopilot softer; "
    "then fly again and compare.",
    "clipping": "The accelerometer's range does not suffice: damp the mount, look for a loose part "
    "that strikes the airframe.",
    "attitude_velocity": "Look at the receiver first: antenna, jamming, spoofing; if its velocity "
    "was right, distrust the attitude and look at vibration and the IMU.",
    "attitude_gravity": "The attitude drifted while nothing else held it: look at vibration and "
    "gyro bias, and calibrate the accelerometers level.",
    "gyro_field": "Gyro and compass turned differently: look at the gyro's scale, the board's "
    "orientation setting (AHRS_ORIENTATION, SENS_BOARD_ROT) and at vibration.",
    "compass_field": "Look for magnets, currents and steel near the compass; mount it farther from "
    "the power wires and calibrate it where you fly.",
    "autopilot_tilt": "Compare vibration, accelerometer and GPS findings of the same time; the "
    "autopilot's estimator or ours was led astray by one of them.",
    "autopilot_heading": "Compare the compass findings of the same time; calibrate the compass or "
    "let another source give the heading (EK3_SRC1_YAW, GSF; EKF2_MAG_TYPE).",
    # The whole flight.
    "vibration_level": "Balance propellers, look for cracks and loose parts, mount the autopilot "
    "softer.",
    "clipped_samples": "Damp the mount and look for parts that strike the airframe; a hard landing "
    "alone gives a few dozen.",
    "vibration_line": "Set the notch as advised and fly again: the line has to be gone behind the "
    "filter. A line that is no multiple of the motors' speed is a resonance of a part.",
    "gyro_bias": "Let the vehicle stand still and warm up when it is switched on; calibrate the "
    "gyro (and its temperature: TCAL, TC_G_ENABLE). If it stays, replace the IMU.",
    "gyro_bias_step": "A gyro that jumps was shocked or is failing: look at vibration and impacts "
    "at that time; do not trust this IMU again.",
    "gyro_apart": "Calibrate the gyros at rest; if the difference stays, switch the odd IMU off.",
    "accelerometer_bias": "Calibrate the accelerometers in six positions.",
    "accelerometer_apart": "Calibrate the accelerometers in six positions; if the difference "
    "stays, switch the odd IMU off.",
    "compass_step": "Find what came near the compass at that time: payload, gripper, camera, "
    "battery wire. Keep it away, or give that compass up (COMPASS_USE, CAL_MAGn_PRIO).",
    "compass_hard_iron": "Calibrate the compass outdoors with everything mounted, or set the "
    "offsets as given.",
    "compass_soft_iron": "Calibrate the compass; move it away from steel parts.",
    "compass_scale": "Check the compass's type and its scale (COMPASS_SCALE); calibrate it.",
    "compass_motors": "Twist the power wires and mount the compass higher; then set COMPASS_MOT "
    "(compassmot), or CAL_MAG_COMP_TYP for PX4.",
    "gps_lag": "Set the receiver's delay (GPS1_DELAY_MS, EKF2_GPS_DELAY); raise its rate and the "
    "speed of its serial line.",
    "gps_velocity": "Compare with other findings of the time: jamming and spoofing show here, and "
    "so does an attitude that was wrong.",
    "gps_jump": "Look for jamming, multipath near buildings and the antenna's view of the sky.",
    "gps_lost": "Check the antenna and its cable, and for transmitters near it (video, USB 3).",
    "gps_satellites": "Give the antenna a free view of the sky and distance from transmitters.",
    "gps_accuracy": "Give the antenna a free view of the sky and distance from transmitters.",
    "imu_gaps": "In an autopilot's log: a faster card, fewer messages (LOG_BITMASK). On a link: "
    "more bandwidth, fewer streams.",
    "imu_slow": "Record the IMU faster: LOG_BITMASK with fast attitude and IMU, SDLOG_PROFILE, or "
    "a stream of 50 Hz and more.",
    "imu_twice": "The stream is faster than the sensor's new values: ask for a lower rate.",
    "clock_drift": "One of the clocks is off: look at the recorder's time synchronisation (NTP "
    "steps) and at the autopilot's board.",
    "late_bursts": "Look at the link: radio bandwidth, buffers, load of the companion computer.",
    "estimator_switch": "Look at what the lane that was left had: its IMU, its compass, vibration.",
    "attitude_reset": "Once after take-off is usual; otherwise look at compass and GPS findings "
    "of that time.",
    "cores_differ": "Compare the sensors that each core uses; look at the findings of each IMU.",
    "autopilot_tilt_off": "Look at vibration, accelerometer and GPS findings of the same time.",
    "autopilot_heading_off": "Look at the compass findings of the same time.",
    "said_ekf_failed": "The autopilot's estimator gave up: look at compass, GPS and vibration "
    "findings before it.",
    "said_gps_glitch": "Look at the receiver's findings of the time.",
    "said_compass": "Look at the compass findings of the time; calibrate.",
    "said_aiding": "Without position the EKF drifts: look for what happened to the receiver.",
    "said_yaw_reset": "The autopilot found its heading wrong: look at the compass findings.",
    "said_vibration": "Look at the vibration findings; balance and damp.",
    "said_sensor": "Look at the findings of the IMU of that time.",
    "said_crash": "Look at what was found in the seconds before.",
    "toppled": "Look at the worst findings in the seconds before the impact.",
}


def remedy(kind: str) -> str:
    """What to check or to set; empty for a kind that nothing is known of."""
    return REMEDIES.get(kind, "")
