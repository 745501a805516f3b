/* Madgwick's gradient-descent filter for gravity and field, in single precision. */
#include "bench_float.h"

static float q[4];
static const float BETA = 0.05f;

void bench_init(void)
{
    q[0] = 1.0f;
}

/* Adds J^T f for a direction (b0, 0, b2) in n that is measured as v in the body frame. */
static void add_gradient(float *gradient, const float *v, float b0, float b2)
{
    const float w0 = q[0], x = q[1], y = q[2], z = q[3];
    const float f0 = 2.0f * b0 * (0.5f - y * y - z * z) + 2.0f * b2 * (x * z - w0 * y) - v[0];
    const float f1 = 2.0f * b0 * (x * y - w0 * z) + 2.0f * b2 * (w0 * x + y * z) - v[1];
    const float f2 = 2.0f * b0 * (w0 * y + x * z) + 2.0f * b2 * (0.5f - x * x - y * y) - v[2];
    gradient[0] += -2.0f * b2 * y * f0 + (-2.0f * b0 * z + 2.0f * b2 * x) * f1 + 2.0f * b0 * y * f2;
    gradient[1] += 2.0f * b2 * z * f0 + (2.0f * b0 * y + 2.0f * b2 * w0) * f1 +
                   (2.0f * b0 * z - 4.0f * b2 * x) * f2;
    gradient[2] += (-4.0f * b0 * y - 2.0f * b2 * w0) * f0 + (2.0f * b0 * x + 2.0f * b2 * z) * f1 +
                   (2.0f * b0 * w0 - 4.0f * b2 * y) * f2;
    gradient[3] += (-4.0f * b0 * z + 2.0f * b2 * x) * f0 + (-2.0f * b0 * w0 + 2.0f * b2 * y) * f1 +
                   2.0f * b0 * x * f2;
}

static void filter_step(void)
{
    const float w0 = q[0], x = q[1], y = q[2], z = q[3];
    float gradient[4] = {0.0f, 0.0f, 0.0f, 0.0f};
    normalise(a, 3);
    add_gradient(gradient, a, 0.0f, 1.0f);
    if (has_field) {
        normalise(m, 3);
        const float h0 = 2.0f * (m[0] * (0.5f - y * y - z * z) + m[1] * (x * y - w0 * z) +
                                 m[2] * (x * z + w0 * y));
        const float h1 = 2.0f * (m[0] * (x * y + w0 * z) + m[1] * (0.5f - x * x - z * z) +
                                 m[2] * (y * z - w0 * x));
        const float h2 = 2.0f * (m[0] * (x * z - w0 * y) + m[1] * (y * z + w0 * x) +
                                 m[2] * (0.5f - x * x - y * y));
        add_gradient(gradient, m, sqrtf(h0 * h0 + h1 * h1), h2);
    }
    normalise(gradient, 4);
    q[0] += DT * (0.5f * (-x * w[0] - y * w[1] - z * w[2]) - BETA * gradient[0]);
    q[1] += DT * (0.5f * (w0 * w[0] + y * w[2] - z * w[1]) - BETA * gradient[1]);
    q[2] += DT * (0.5f * (w0 * w[1] - x * w[2] + z * w[0]) - BETA * gradient[2]);
    q[3] += DT * (0.5f * (w0 * w[2] + x * w[1] - y * w[0]) - BETA * gradient[3]);
    normalise(q, 4);
}

uint32_t bench_result(void)
{
    return word_of(q[0]);
}
