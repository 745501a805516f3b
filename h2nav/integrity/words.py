"""Sentences that several kinds of finding share: what they mean, and what to check next."""

FROZEN = "The sensor repeated itself while the vehicle moved: it had stopped measuring."
SENSOR = "The sensor's wiring, bus and supply; if it comes back, replace the sensor."
MAGNET = (
    "Magnets, motors and wires with high current near the compass; move the compass away "
    "from them, calibrate it again, or rely on another one."
)
SHAKEN = "Shaking this strong makes the autopilot's accelerometer hard to use."
VIBRATION = (
    "Propellers (balance, damage), motor bearings, loose parts, and how the autopilot is mounted."
)
CLIPPED = "Samples at the end of the sensor's range: the true values were larger."
RECEIVER = "The antenna's view of the sky and its distance to cameras, transmitters and USB 3."
BIAS = "Calibrate the sensor again, with temperature if it can be; if it stays so, replace it."
LINK = "The recording's rate and the processor's load; what was lost cannot be judged."
COMPASS_WRONG = (
    "What the compass measured is not the earth's field at this place (World Magnetic Model), "
    "so a heading by this compass is wrong."
)
SAID = "The autopilot's documentation of this message, and the pictures at that time."
MOTOR = "Propeller, motor, bearing, speed controller and their wires, by hand and by a test bench."
