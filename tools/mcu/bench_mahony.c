/* Mahony's complementary filter with integral term, gravity and field, in single precision. */
#include "bench_float.h"

static float q[4], bias[3];
static const float KP = 1.0f, KI = 0.05f;

void bench_init(void)
{
    q[0] = 1.0f;
}

static void filter_step(void)
{
    const float w0 = q[0], x = q[1], y = q[2], z = q[3];
    float e[3];
    /* down in the body frame */
    const float d0 = 2.0f * (x * z - w0 * y);
    const float d1 = 2.0f * (w0 * x + y * z);
    const float d2 = w0 * w0 - x * x - y * y + z * z;
    normalise(a, 3);
    e[0] = a[1] * d2 - a[2] * d1;
    e[1] = a[2] * d0 - a[0] * d2;
    e[2] = a[0] * d1 - a[1] * d0;
    if (has_field) {
        float h[3], b0, b2, v0, v1, v2;
        normalise(m, 3);
        h[0] = 2.0f * (m[0] * (0.5f - y * y - z * z) + m[1] * (x * y - w0 * z) +
                       m[2] * (x * z + w0 * y));
        h[1] = 2.0f * (m[0] * (x * y + w0 * z) + m[1] * (0.5f - x * x - z * z) +
                       m[2] * (y * z - w0 * x));
        h[2] = 2.0f * (m[0] * (x * z - w0 * y) + m[1] * (y * z + w0 * x) +
                       m[2] * (0.5f - x * x - y * y));
        b0 = sqrtf(h[0] * h[0] + h[1] * h[1]);
        b2 = h[2];
        v0 = 2.0f * (b0 * (0.5f - y * y - z * z) + b2 * (x * z - w0 * y));
        v1 = 2.0f * (b0 * (x * y - w0 * z) + b2 * (w0 * x + y * z));
        v2 = 2.0f * (b0 * (w0 * y + x * z) + b2 * (0.5f - x * x - y * y));
        e[0] += m[1] * v2 - m[2] * v1;
        e[1] += m[2] * v0 - m[0] * v2;
        e[2] += m[0] * v1 - m[1] * v0;
    }
    float h[3];
    for (int32_t i = 0; i < 3; i++) {
        bias[i] -= KI * DT * e[i];
        h[i] = 0.5f * DT * (w[i] - bias[i] + KP * e[i]);
    }
    q[0] = w0 - x * h[0] - y * h[1] - z * h[2];
    q[1] = x + w0 * h[0] + y * h[2] - z * h[1];
    q[2] = y + w0 * h[1] - x * h[2] + z * h[0];
    q[3] = z + w0 * h[2] + x * h[1] - y * h[0];
    normalise(q, 4);
}

uint32_t bench_result(void)
{
    return word_of(q[0]);
}
