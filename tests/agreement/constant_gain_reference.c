/* The filter of constant_gain_reference.py for long flights, and the flight; a test compares both.
 *
 * Quaternions scalar first, body to north-east-down; angles in radians, times in seconds.
 */
#include <math.h>
#include <stddef.h>
#include <string.h>

typedef struct {
    double q[4], bias[3], pending[3], age;
} reference;

typedef struct {
    double attitude[5], bias[5]; /* xx, xz, yy, zx, zz */
    double weight, dip, boost_s, dt, force_tolerance, field_tolerance, dip_tolerance;
} settings;

/* q <- q (w, v) */
static void multiply(double q[4], double w, const double v[3])
{
    const double a = q[0], b = q[1], c = q[2], d = q[3];
    q[0] = w * a - v[0] * b - v[1] * c - v[2] * d;
    q[1] = w * b + v[0] * a + v[2] * c - v[1] * d;
    q[2] = w * c + v[1] * a + v[0] * d - v[2] * b;
    q[3] = w * d + v[2] * a + v[1] * b - v[0] * c;
}

static void rotation(const double q[4], double r[9])
{
    const double w = q[0], x = q[1], y = q[2], z = q[3];
    const double rows[9] = {
        w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y),
        2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x),
        2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z};
    memcpy(r, rows, sizeof rows);
}

/* Turns q by each row of rates; writes each attitude's matrix. */
void fly(double q[4], double dt, const double *rates, size_t rows, double *matrices)
{
    for (size_t row = 0; row < rows; row++) {
        double half[3];
        for (int i = 0; i < 3; i++) {
            half[i] = 0.5 * dt * rates[3 * row + i];
        }
        multiply(q, 1.0, half);
        const double norm = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
        for (int i = 0; i < 4; i++) {
            q[i] /= norm;
        }
        rotation(q, matrices + 9 * row);
    }
}

static double squared(const double v[3])
{
    return v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
}

/* R^T K zeta, scaled. */
static void corrected(const double r[9], const double k[5], const double z[3], double scale,
                      double out[3])
{
    const double e[3] = {k[0] * z[0] + k[1] * z[2], k[2] * z[1], k[3] * z[0] + k[4] * z[2]};
    for (int i = 0; i < 3; i++) {
        out[i] = scale * (r[i] * e[0] + r[3 + i] * e[1] + r[6 + i] * e[2]);
    }
}

static void turned(const double r[9], const double v[3], double out[3])
{
    for (int i = 0; i < 3; i++) {
        out[i] = r[3 * i] * v[0] + r[3 * i + 1] * v[1] + r[3 * i + 2] * v[2];
    }
}

static void update(reference *x, const settings *s, const double w[3], const double g_b[3],
                   const double *f_b)
{
    double turn[3], r[9], g[3], f[3], zeta[3] = {0, 0, 0}, change[3];
    const double north = cos(s->dip), down = sin(s->dip);
    for (int i = 0; i < 3; i++) {
        turn[i] = (w[i] - x->bias[i]) * s->dt + x->pending[i];
    }
    const double angle = sqrt(squared(turn));
    const double factor = angle > 0.0 ? sin(0.5 * angle) / angle : 0.5;
    for (int i = 0; i < 3; i++) {
        turn[i] *= factor;
    }
    multiply(x->q, cos(0.5 * angle), turn);
    rotation(x->q, r);
    if (fabs(squared(g_b) - 1.0) <= s->force_tolerance) {
        turned(r, g_b, g);
        zeta[0] += s->weight * g[1];
        zeta[1] -= s->weight * g[0];
    }
    if (f_b != NULL && fabs(squared(f_b) - 1.0) <= s->field_tolerance) {
        turned(r, f_b, f);
        if (fabs(f[2] - down) <= s->dip_tolerance || x->age < 3.0 * s->boost_s) {
            zeta[0] += (1.0 - s->weight) * f[1] * down;
            zeta[1] += (1.0 - s->weight) * (f[2] * north - f[0] * down);
            zeta[2] -= f[1] * north;
        }
    }
    const double young = 3.0 - floor(x->age / s->boost_s);
    const double boost = exp2(young > 0.0 ? young : 0.0);
    x->age += s->dt;
    corrected(r, s->attitude, zeta, boost, x->pending);
    corrected(r, s->bias, zeta, boost * boost, change);
    for (int i = 0; i < 3; i++) {
        x->bias[i] -= change[i];
    }
}

/* Samples are rows of rate, gravity, field, and one for a field, else zero; writes q and bias. */
void run_reference(reference *x, const settings *s, const double *samples, size_t rows,
                   double *results)
{
    for (size_t row = 0; row < rows; row++) {
        const double *sample = samples + 10 * row;
        update(x, s, sample, sample + 3, sample[9] != 0.0 ? sample + 6 : NULL);
        memcpy(results + 7 * row, x->q, sizeof x->q);
        memcpy(results + 7 * row + 4, x->bias, sizeof x->bias);
    }
}
