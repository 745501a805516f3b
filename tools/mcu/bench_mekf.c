/* Multiplicative extended Kalman filter, attitude and bias, in single precision.
 *
 * Six scalar updates per sample with field, three without; the propagation uses the structure of
 * its transition matrix, so that this is the sparing form, not the textbook one.
 */
#include "bench_float.h"

static float q[4], bias[3], p[6][6];
static const float GYRO = 1e-6f, WALK = 1e-10f, NOISE = 1e-3f;
static const float FIELD[3] = {0.5f, 0.0f, 0.8660254f};
static const float GRAVITY[3] = {0.0f, 0.0f, 1.0f};

void bench_init(void)
{
    q[0] = 1.0f;
    for (int32_t i = 0; i < 6; i++) {
        p[i][i] = 0.01f;
    }
}

static void turn(const float *angle)
{
    const float x = 0.5f * angle[0], y = 0.5f * angle[1], z = 0.5f * angle[2];
    const float q0 = q[0], q1 = q[1], q2 = q[2], q3 = q[3];
    q[0] = q0 - q1 * x - q2 * y - q3 * z;
    q[1] = q1 + q0 * x + q2 * z - q3 * y;
    q[2] = q2 + q0 * y - q1 * z + q3 * x;
    q[3] = q3 + q0 * z + q1 * y - q2 * x;
    normalise(q, 4);
}

/* P <- F P F^T + Q with F = [I - [w dt]x, -dt I; 0, I]. */
static void propagate(const float *angle)
{
    const float x = angle[0], y = angle[1], z = angle[2];
    for (int32_t j = 0; j < 6; j++) {
        const float c0 = p[0][j], c1 = p[1][j], c2 = p[2][j];
        p[0][j] = c0 + z * c1 - y * c2 - DT * p[3][j];
        p[1][j] = c1 - z * c0 + x * c2 - DT * p[4][j];
        p[2][j] = c2 + y * c0 - x * c1 - DT * p[5][j];
    }
    for (int32_t i = 0; i < 6; i++) {
        const float r0 = p[i][0], r1 = p[i][1], r2 = p[i][2];
        p[i][0] = r0 + z * r1 - y * r2 - DT * p[i][3];
        p[i][1] = r1 - z * r0 + x * r2 - DT * p[i][4];
        p[i][2] = r2 + y * r0 - x * r1 - DT * p[i][5];
    }
    for (int32_t i = 0; i < 3; i++) {
        p[i][i] += GYRO;
        p[i + 3][i + 3] += WALK;
    }
}

/* One component: residual r of a measurement whose row of H is (h0, h1, h2, 0, 0, 0). */
static void update(const float *h, float r, float *dx)
{
    float ph[6];
    for (int32_t i = 0; i < 6; i++) {
        ph[i] = p[i][0] * h[0] + p[i][1] * h[1] + p[i][2] * h[2];
    }
    const float s = h[0] * ph[0] + h[1] * ph[1] + h[2] * ph[2] + NOISE;
    const float scale = 1.0f / s;
    r = (r - (h[0] * dx[0] + h[1] * dx[1] + h[2] * dx[2])) * scale;
    for (int32_t i = 0; i < 6; i++) {
        const float k = ph[i] * scale;
        dx[i] += ph[i] * r;
        for (int32_t j = i; j < 6; j++) {
            p[i][j] -= k * ph[j];
            p[j][i] = p[i][j];
        }
    }
}

static void use_direction(const float *v, const float *reference, float *dx)
{
    const float w0 = q[0], x = q[1], y = q[2], z = q[3];
    const float n0 = reference[0], n2 = reference[2];
    const float b0 = n0 * (1.0f - 2.0f * (y * y + z * z)) + n2 * 2.0f * (x * z - w0 * y);
    const float b1 = n0 * 2.0f * (x * y - w0 * z) + n2 * 2.0f * (y * z + w0 * x);
    const float b2 = n0 * 2.0f * (x * z + w0 * y) + n2 * (1.0f - 2.0f * (x * x + y * y));
    const float rows[3][3] = {{0.0f, -b2, b1}, {b2, 0.0f, -b0}, {-b1, b0, 0.0f}};
    update(rows[0], v[0] - b0, dx);
    update(rows[1], v[1] - b1, dx);
    update(rows[2], v[2] - b2, dx);
}

static void filter_step(void)
{
    float angle[3], dx[6] = {0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f};
    for (int32_t i = 0; i < 3; i++) {
        angle[i] = (w[i] - bias[i]) * DT;
    }
    turn(angle);
    propagate(angle);
    normalise(a, 3);
    use_direction(a, GRAVITY, dx);
    if (has_field) {
        normalise(m, 3);
        use_direction(m, FIELD, dx);
    }
    turn(dx);
    for (int32_t i = 0; i < 3; i++) {
        bias[i] += dx[i + 3];
    }
}

uint32_t bench_result(void)
{
    return word_of(q[0]);
}
