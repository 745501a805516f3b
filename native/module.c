/* Python's door to the compiled kernels: buffers in, buffers out, nothing allocated.
 *
 * run_<kernel>(memory, gains, samples, columns, results)
 *   memory   writable buffer, changed in place
 *   gains    buffer
 *   samples  rows of `columns` numbers
 *   results  writable buffer, one row of 8 numbers per sample
 * kernel_digest tells which version of the Python kernels the C was translated from.
 * Numbers are C doubles or 32-bit integers, as the kernel's name says.
 */
#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <stddef.h>
#include <stdint.h>

enum { RESULT_COLUMNS = 8, BUFFERS = 4, BATCH_ROWS = 64 };

void run_shaped(double *memory, const double *gains, const double *samples, size_t rows,
                size_t columns, double *results);
void run_fixed_lean(int32_t *memory, const int32_t *gains, const int32_t *samples, size_t rows,
                    size_t columns, int32_t *results);
void run_fixed_flight(int32_t *memory, const int32_t *gains, const int32_t *samples, size_t rows,
                      size_t columns, int32_t *results);

enum kernel { SHAPED, FIXED_LEAN, FIXED_FLIGHT };

/* The number of rows, or -1 with an error set when the buffers do not fit together. */
static Py_ssize_t rows_of(const Py_buffer *samples, const Py_buffer *results, Py_ssize_t columns,
                          Py_ssize_t size)
{
    if (columns < 1 || samples->len % (columns * size) != 0) {
        PyErr_SetString(PyExc_ValueError, "samples are not rows of the given number of columns");
        return -1;
    }
    const Py_ssize_t rows = samples->len / (columns * size);
    if (results->len != rows * RESULT_COLUMNS * size) {
        PyErr_SetString(PyExc_ValueError, "results need one row of 8 numbers per sample");
        return -1;
    }
    return rows;
}

static PyObject *run(PyObject *arguments, enum kernel kernel)
{
    Py_buffer buffers[BUFFERS];
    Py_ssize_t columns = 0;
    if (!PyArg_ParseTuple(arguments, "w*y*y*nw*", &buffers[0], &buffers[1], &buffers[2], &columns,
                          &buffers[3])) {
        return NULL;
    }
    const Py_ssize_t size = (Py_ssize_t)(kernel == SHAPED ? sizeof(double) : sizeof(int32_t));
    const Py_ssize_t rows = rows_of(&buffers[2], &buffers[3], columns, size);
    if (rows >= 0) {
        /* Other threads may run beside a batch; a single sample is shorter than the hand-over. */
        PyThreadState *thread = rows >= BATCH_ROWS ? PyEval_SaveThread() : NULL;
        if (kernel == SHAPED) {
            run_shaped(buffers[0].buf, buffers[1].buf, buffers[2].buf, (size_t)rows,
                       (size_t)columns, buffers[3].buf);
        } else if (kernel == FIXED_LEAN) {
            run_fixed_lean(buffers[0].buf, buffers[1].buf, buffers[2].buf, (size_t)rows,
                           (size_t)columns, buffers[3].buf);
        } else {
            run_fixed_flight(buffers[0].buf, buffers[1].buf, buffers[2].buf, (size_t)rows,
                             (size_t)columns, buffers[3].buf);
        }
        if (thread != NULL) {
            PyEval_RestoreThread(thread);
        }
    }
    for (int i = 0; i < BUFFERS; i++) {
        PyBuffer_Release(&buffers[i]);
    }
    if (rows < 0) {
        return NULL;
    }
    Py_RETURN_NONE;
}

static PyObject *shaped(PyObject *self, PyObject *arguments)
{
    (void)self;
    return run(arguments, SHAPED);
}

static PyObject *fixed_lean(PyObject *self, PyObject *arguments)
{
    (void)self;
    return run(arguments, FIXED_LEAN);
}

static PyObject *fixed_flight(PyObject *self, PyObject *arguments)
{
    (void)self;
    return run(arguments, FIXED_FLIGHT);
}

static PyMethodDef methods[] = {
    {"run_shaped", shaped, METH_VARARGS, "Rows of doubles through the default filter's step."},
    {"run_fixed_lean", fixed_lean, METH_VARARGS, "Rows of integers through the lean filter."},
    {"run_fixed_flight", fixed_flight, METH_VARARGS,
     "Rows of integers through the default filter in integers."},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef definition = {
    .m_base = PyModuleDef_HEAD_INIT,
    .m_name = "_native",
    .m_doc = "The filters' kernels, compiled.",
    .m_size = -1,
    .m_methods = methods,
};

PyMODINIT_FUNC PyInit__native(void)
{
    PyObject *module = PyModule_Create(&definition);
    if (module != NULL && PyModule_AddStringConstant(module, "kernel_digest", KERNEL_DIGEST) != 0) {
        Py_DECREF(module);
        return NULL;
    }
    return module;
}
