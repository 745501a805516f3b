"""Prints the table of docs/rotations.md: first-order quaternion update against exponential."""

from h2nav.maths import quaternion, rotation_derivatives


def table() -> str:
    lines = [
        "| angle of w [rad] | length of [1, w/2] | turns by [rad] | error [rad] | relative |",
        "|---|---|---|---|---|",
    ]
    for angle in (0.01, 0.1, 1.0):
        turned = rotation_derivatives.first_order_angle(angle)
        length = rotation_derivatives.first_order_norm(angle)
        exact = quaternion.angle(quaternion.IDENTITY, quaternion.exp((0.0, 0.0, angle)))
        error = exact - turned
        lines.append(
            f"| {angle:g} | {length:.6f} | {turned:.9f} | {error:.2e} | {error / angle:.1e} |"
        )
    return "\n".join(lines)


if __name__ == "__main__":
    print(table())
