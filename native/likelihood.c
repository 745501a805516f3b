/* The arithmetic of integrity/normal_equations.py and integrity/composition.py, which say what each
 * function does. Sums are added in the order in which Python adds them, so that the bits are the
 * same. All buffers hold doubles; triangles are packed, row by row. */
#include "likelihood.h"

#include <math.h>
#include <string.h>

enum { MAX_BUFFERS = 9, MAX_COLUMNS = 64 };

static size_t numbers(const Py_buffer *buffer)
{
    return (size_t)buffer->len / sizeof(double);
}

static PyObject *released(Py_buffer *buffers, int count, int fits, double result)
{
    for (int i = 0; i < count; i++) {
        PyBuffer_Release(&buffers[i]);
    }
    if (!fits) {
        PyErr_SetString(PyExc_ValueError, "the sizes of the buffers do not fit together");
        return NULL;
    }
    return PyFloat_FromDouble(result);
}

static double dot(const double *a, const double *b, size_t count)
{
    double sum = 0.0;
    for (size_t i = 0; i < count; i++) {
        sum += a[i] * b[i];
    }
    return sum;
}

static const double *row_of(const double *root, size_t number)
{
    return root + number * (number + 1) / 2;
}

/* Another row of a root, but for its diagonal. */
static void next_row(const double *products, const double *sigmas, double scale,
                     const double *root, size_t count, double *row)
{
    for (size_t i = 0; i < count; i++) {
        const double *line = row_of(root, i);
        row[i] = (scale * products[i] * sigmas[i] - dot(row, line, i)) / line[i];
    }
}

/* Closes a row by its diagonal and its forward solution; what it adds to the likelihood. */
static double append_row(double *row, double *forward, size_t count, double size, double right)
{
    const double pivot = sqrt(1.0 + size - dot(row, row, count));
    const double solved = (right - dot(row, forward, count)) / pivot;
    row[count] = pivot;
    forward[count] = solved;
    return 0.5 * solved * solved - log(pivot);
}

PyObject *likelihood_whiten(PyObject *self, PyObject *arguments)
{
    Py_buffer b[MAX_BUFFERS];
    (void)self;
    if (!PyArg_ParseTuple(arguments, "y*y*w*", &b[0], &b[1], &b[2])) {
        return NULL;
    }
    const size_t wide = numbers(&b[0]), all = numbers(&b[1]), count = wide / 2;
    const int fits = wide > 0 && wide % 2 == 0 && all % wide == 0 && all == numbers(&b[2]);
    if (fits) {
        const double *factors = b[0].buf, *value = b[1].buf;
        double *white = b[2].buf;
        for (size_t at = 0; at < all; at += wide) {
            for (size_t axis = 0; axis < 2; axis++) {
                double before = 0.0;
                for (size_t i = 0; i < count; i++) {
                    const double *factor = factors + 2 * i;
                    before = factor[0] * (*value++ - factor[1] * before);
                    white[at + 2 * i + axis] = before;
                }
            }
        }
    }
    return released(b, 3, fits, 0.0);
}

PyObject *likelihood_products(PyObject *self, PyObject *arguments)
{
    Py_buffer b[MAX_BUFFERS];
    Py_ssize_t length = 0, skipped = 0;
    (void)self;
    if (!PyArg_ParseTuple(arguments, "y*y*nnw*", &b[0], &b[1], &length, &skipped, &b[2])) {
        return NULL;
    }
    const size_t of_one = numbers(&b[0]), of_other = numbers(&b[1]);
    const size_t wide = (size_t)length + (size_t)skipped;
    const int fits = length > 0 && skipped >= 0 && of_one % (size_t)length == 0 &&
                     of_other % wide == 0 &&
                     of_one / (size_t)length * (of_other / wide) == numbers(&b[2]);
    if (fits) {
        const double *one = b[0].buf, *other = b[1].buf;
        double *found = b[2].buf;
        for (size_t i = 0; i < of_one; i += (size_t)length) {
            for (size_t j = (size_t)skipped; j < of_other; j += wide) {
                *found++ = dot(one + i, other + j, (size_t)length);
            }
        }
    }
    return released(b, 3, fits, 0.0);
}

PyObject *likelihood_fit(PyObject *self, PyObject *arguments)
{
    Py_buffer b[MAX_BUFFERS];
    double likelihood = 0.0;
    (void)self;
    if (!PyArg_ParseTuple(arguments, "y*y*y*w*w*", &b[0], &b[1], &b[2], &b[3], &b[4])) {
        return NULL;
    }
    const size_t count = numbers(&b[2]);
    const int fits = numbers(&b[0]) == count * count && numbers(&b[1]) == count &&
                     numbers(&b[3]) == count * (count + 1) / 2 && numbers(&b[4]) == count;
    if (fits) {
        const double *products = b[0].buf, *right = b[1].buf, *sigmas = b[2].buf;
        double *root = b[3].buf, *forward = b[4].buf;
        for (size_t i = 0; i < count; i++) {
            const double *line = products + i * count, scale = sigmas[i];
            double *row = root + i * (i + 1) / 2;
            next_row(line, sigmas, scale, root, i, row);
            likelihood += append_row(row, forward, i, scale * scale * line[i], scale * right[i]);
        }
    }
    return released(b, 5, fits, likelihood);
}

/* Further unknowns: products of their columns with those of the fit, with each other, and with the
 * residuals. */
struct further {
    size_t known, shapes;
    const double *sigmas, *crossed, *own, *right;
};

static int fits_together(const struct further *further, const Py_buffer *products,
                         const unsigned char *places, size_t more)
{
    int fits = numbers(&products[0]) == further->shapes * further->known &&
               numbers(&products[1]) == further->shapes * further->shapes;
    for (size_t n = 0; n < more; n++) {
        fits = fits && places[n] < further->shapes;
    }
    return fits;
}

/* Writes rows of a root behind those of the fit; the likelihood with them. `units` has the first
 * part of each unknown's row for a deviation of one, or is NULL. */
static double extended(double likelihood, const struct further *further, const double *units,
                       const unsigned char *places, size_t more, double sigma, double *root,
                       double *forward)
{
    const size_t known = further->known;
    for (size_t n = 0; n < more; n++) {
        const size_t place = places[n], end = known + n;
        const double *own = further->own + place * further->shapes;
        double *row = root + end * (end + 1) / 2;
        if (units == NULL) {
            next_row(further->crossed + place * known, further->sigmas, 1.0, root, known, row);
        } else {
            memcpy(row, units + place * known, known * sizeof *row);
        }
        for (size_t i = 0; i < known; i++) {
            row[i] = sigma * row[i];
        }
        for (size_t i = known; i < end; i++) {
            const double *line = row_of(root, i);
            const double product = sigma * sigma * own[places[i - known]];
            row[i] = (product - dot(row, line, i)) / line[i];
        }
        const double size = sigma * sigma * own[place];
        likelihood += append_row(row, forward, end, size, sigma * further->right[place]);
    }
    return likelihood;
}

PyObject *likelihood_extend(PyObject *self, PyObject *arguments)
{
    Py_buffer b[MAX_BUFFERS];
    double sigma = 0.0, likelihood = 0.0;
    (void)self;
    if (!PyArg_ParseTuple(arguments, "(y*d)(y*y*y*)y*d(w*w*)", &b[0], &likelihood, &b[1], &b[2],
                          &b[3], &b[4], &sigma, &b[5], &b[6])) {
        return NULL;
    }
    const struct further further = {numbers(&b[0]), numbers(&b[3]), b[0].buf, b[1].buf,
                                    b[2].buf,       b[3].buf};
    const size_t more = (size_t)b[4].len, all = further.known + more;
    const int fits = fits_together(&further, &b[1], b[4].buf, more) &&
                     numbers(&b[5]) == all * (all + 1) / 2 && numbers(&b[6]) == all;
    if (fits) {
        likelihood = extended(likelihood, &further, NULL, b[4].buf, more, sigma, b[5].buf,
                              b[6].buf);
    }
    return released(b, 7, fits, likelihood);
}

/* Whether each hypothesis has its places, of further unknowns that exist. */
static int are_whole(const struct further *further, const Py_buffer *products,
                     const Py_buffer *wanted, size_t count)
{
    const unsigned char *at = wanted->buf, *end = at + wanted->len;
    int fits = fits_together(further, products, NULL, 0);
    for (size_t n = 0; fits && n < count; n++) {
        fits = at < end && end - at > *at && *at + further->known <= MAX_COLUMNS &&
               fits_together(further, products, at + 1, *at);
        at += fits ? 1 + *at : 0;
    }
    return fits && at == end;
}

PyObject *likelihood_likelihoods(PyObject *self, PyObject *arguments)
{
    Py_buffer b[MAX_BUFFERS];
    double likelihood = 0.0;
    (void)self;
    if (!PyArg_ParseTuple(arguments, "(y*dy*y*)(y*y*y*)y*y*w*", &b[0], &likelihood, &b[1], &b[2],
                          &b[3], &b[4], &b[5], &b[6], &b[7], &b[8])) {
        return NULL;
    }
    const struct further further = {numbers(&b[0]), numbers(&b[5]), b[0].buf, b[3].buf,
                                    b[4].buf,       b[5].buf};
    const size_t known = further.known, count = numbers(&b[7]);
    const int fits = known <= MAX_COLUMNS && further.shapes <= MAX_COLUMNS &&
                     numbers(&b[1]) == known * (known + 1) / 2 && numbers(&b[2]) == known &&
                     numbers(&b[8]) == count && are_whole(&further, &b[3], &b[6], count);
    if (fits) {
        double root[MAX_COLUMNS * (MAX_COLUMNS + 1) / 2], forward[MAX_COLUMNS];
        double units[MAX_COLUMNS * MAX_COLUMNS], *found = b[8].buf;
        const double *sizes = b[7].buf;
        const unsigned char *wanted = b[6].buf;
        memcpy(root, b[1].buf, (size_t)b[1].len);
        memcpy(forward, b[2].buf, (size_t)b[2].len);
        for (size_t place = 0; place < further.shapes; place++) {
            const size_t at = place * known;
            next_row(further.crossed + at, further.sigmas, 1.0, root, known, units + at);
        }
        for (size_t n = 0; n < count; n++, wanted += 1 + *wanted) {
            found[n] = extended(likelihood, &further, units, wanted + 1, *wanted, sizes[n], root,
                                forward);
        }
    }
    return released(b, 9, fits, 0.0);
}

PyObject *likelihood_unknowns(PyObject *self, PyObject *arguments)
{
    Py_buffer b[MAX_BUFFERS];
    (void)self;
    if (!PyArg_ParseTuple(arguments, "y*y*y*w*", &b[0], &b[1], &b[2], &b[3])) {
        return NULL;
    }
    const size_t count = numbers(&b[1]);
    const int fits = count <= MAX_COLUMNS && numbers(&b[0]) == count * (count + 1) / 2 &&
                     numbers(&b[2]) == count && numbers(&b[3]) == count;
    if (fits) {
        const double *root = b[0].buf, *forward = b[1].buf, *sigmas = b[2].buf;
        double *found = b[3].buf, solved[MAX_COLUMNS];
        for (size_t i = count; i-- > 0;) {
            double rest = 0.0;
            for (size_t k = i + 1; k < count; k++) {
                rest += row_of(root, k)[i] * solved[k];
            }
            solved[i] = (forward[i] - rest) / row_of(root, i)[i];
            found[i] = sigmas[i] * solved[i];
        }
    }
    return released(b, 4, fits, 0.0);
}

PyObject *likelihood_spread(PyObject *self, PyObject *arguments)
{
    Py_buffer b[MAX_BUFFERS];
    (void)self;
    if (!PyArg_ParseTuple(arguments, "y*y*y*w*", &b[0], &b[1], &b[2], &b[3])) {
        return NULL;
    }
    const size_t count = numbers(&b[1]), lines = (size_t)b[2].len;
    const unsigned char *places = b[2].buf;
    int fits = numbers(&b[0]) == count * (count + 1) / 2 && numbers(&b[3]) == lines * count;
    for (size_t n = 0; n < lines; n++) {
        fits = fits && places[n] < count;
    }
    if (fits) {
        const double *root = b[0].buf, *sigmas = b[1].buf;
        double *line = b[3].buf;
        for (size_t n = 0; n < lines; n++, line += count) {
            const size_t place = places[n];
            memset(line, 0, count * sizeof *line);
            for (size_t i = place; i < count; i++) {
                const double *row = row_of(root, i), unit = i == place ? 1.0 : 0.0;
                line[i] = (unit - dot(row, line, i)) / row[i];
            }
            for (size_t i = 0; i < count; i++) {
                line[i] = sigmas[place] * line[i];
            }
        }
    }
    return released(b, 4, fits, 0.0);
}

/* Of integrity/composition.py. */
enum {
    TURNS = 7,
    USED = 6,
    TURNED = 3,
    BENT = TURNED + 3 * TURNS,
    PUSHED = BENT + 3 * TURNS,
    NUMBERS = PUSHED + 6,
    MEASURED = 12,
    COLUMNS = 17
};

static double along(const double *axis, const double *v)
{
    return axis[0] * v[0] + axis[1] * v[1] + axis[2] * v[2];
}

static void in_n(const double *to_n, const double *v, double *found)
{
    for (size_t axis = 0; axis < 3; axis++) {
        found[axis] = along(to_n + 3 * axis, v);
    }
}

/* One row of the table, of one axis: what is left, and the effects of all unknowns. */
static void compose_row(const double *known, const double *bent, const double *tilt,
                        const double *measured, double gained, double *column, size_t wide)
{
    double expected = 0.0 + known[0] * bent[0] + known[1] * bent[1] + known[2] * bent[2];
    expected = expected - bent[USED] + (known[3] * bent[TURNS] + known[4] * bent[TURNS + 1]);
    *column = measured[0] - gained - expected;
    for (size_t i = 0; i < 3; i++) {
        *(column += wide) = tilt[i];
    }
    for (size_t i = 0; i < TURNS + 2; i++) {
        if (i != USED) {
            *(column += wide) = bent[i];
        }
    }
    for (size_t i = 2; i < MEASURED; i += 2) {
        *(column += wide) = measured[i];
    }
}

PyObject *likelihood_compose(PyObject *self, PyObject *arguments)
{
    Py_buffer b[MAX_BUFFERS];
    (void)self;
    if (!PyArg_ParseTuple(arguments, "y*y*y*y*(w*w*w*w*)", &b[0], &b[1], &b[2], &b[3], &b[4],
                          &b[5], &b[6], &b[7])) {
        return NULL;
    }
    const size_t rows = numbers(&b[3]) / MEASURED;
    const int fits = numbers(&b[0]) == 9 && numbers(&b[1]) == 5 &&
                     numbers(&b[2]) == rows * NUMBERS && numbers(&b[3]) == rows * MEASURED &&
                     numbers(&b[4]) == 2 * rows * COLUMNS && numbers(&b[5]) == 3 * rows &&
                     numbers(&b[6]) == 9 * rows && numbers(&b[7]) == 3 * TURNS;
    if (fits) {
        const double *to_n = b[0].buf, *known = b[1].buf, *own = b[2].buf, *measured = b[3].buf;
        double *table = b[4].buf, *g = b[5].buf, *turns = b[6].buf, *in_all = b[7].buf;
        double turned[3 * TURNS] = {0.0};
        for (size_t row = 0; row < rows; row++, own += NUMBERS, measured += MEASURED, g += 3) {
            double bent[2][TURNS + 2];
            for (size_t k = 0; k < TURNS + 2; k++) {
                const double *v = own + BENT + 3 * k;
                double sum[3] = {v[0], v[1], v[2]};
                if (k < TURNS) {
                    const double *t = turned + 3 * k;
                    sum[0] += t[1] * own[2] - t[2] * own[1];
                    sum[1] += t[2] * own[0] - t[0] * own[2];
                    sum[2] += t[0] * own[1] - t[1] * own[0];
                }
                bent[0][k] = along(to_n, sum);
                bent[1][k] = along(to_n + 3, sum);
            }
            in_n(to_n, own, g);
            const double tilts[2][3] = {{0.0, g[2], -g[1]}, {-g[2], 0.0, g[0]}};
            for (size_t axis = 0; axis < 2; axis++) {
                compose_row(known, bent[axis], tilts[axis], measured + axis, g[axis],
                            table + axis * rows + row, 2 * rows);
            }
            for (size_t k = 0; k < 3; k++) {
                in_n(to_n, turned + 3 * k, turns + 9 * row + 3 * k);
            }
            for (size_t i = 0; i < 3 * TURNS; i++) {
                turned[i] += own[TURNED + i];
            }
        }
        for (size_t k = 0; k < TURNS; k++) {
            in_n(to_n, turned + 3 * k, in_all + 3 * k);
        }
    }
    return released(b, 8, fits, 0.0);
}
