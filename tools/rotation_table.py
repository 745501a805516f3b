"""Prints the table of docs/rotations.md: first-order quaternion update against exponential."""

import math

from h2nav.maths import quaternion


def table() -> str:
    lines = [
        "| angle of w [rad] | length of [1, w/2] | turns by [rad] | error [rad] | relative |",
        "|---|---|---|---|---|",
    ]
    for angle in (0.01, 0.1, 1.0):
        turned = 2.0 * math.atan(0.5 * angle)  # docs/rotations.md Eq. (5)
        length = math.hypot(1.0, 0.5 * angle)  # Eq. (6)
        exact = quaternion.angle(quaternion.IDENTITY, quaternion.exp((0.0, 0.0, angle)))
        error = exact - turned
        lines.append(
            f"| {angle:g} | {length:.6f} | {turned:.9f} | {error:.2e} | {error / angle:.1e} |"
        )
    return "\n".join(lines)


if __name__ == "__main__":
    print(table())
