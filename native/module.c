/* Python's door to the compiled kernels: buffers in, buffers out, nothing allocated.
 *
 * run(kernel, state, workspace, gains, samples, results)
 *   kernel     its number
 *   state      writable buffer: what the kernel remembers, changed in place
 *   workspace  writable buffer: where it works out a step; empty for a kernel that needs none
 *   gains      buffer: its gains
 *   samples    buffer: samples, one behind the other
 *   results    writable buffer, one row of 10 numbers per sample: attitude, bias, bits, and, of
 *              kernels that work them out, deviations of tilt and heading
 * It returns the bits of the last sample.
 * kernel_digest tells which version of the Python kernels the C was translated from, number_codes
 * of each kernel whether its numbers are doubles (d) or 32-bit integers (i).
 */
#define PY_SSIZE_T_CLEAN
#include <Python.h>

#include "kernels.h"
#include "likelihood.h"

static const struct kernel *const kernels[] = {KERNELS_IN_ORDER};

enum {
    RESULT_COLUMNS = 10,
    BUFFERS = 5,
    BATCH_ROWS = 64,
    KERNELS = sizeof kernels / sizeof *kernels
};

/* The number of samples, or -1 with an error set when the buffers do not fit together. */
static Py_ssize_t rows_of(const struct kernel *kernel, const Py_buffer *buffers)
{
    if ((size_t)buffers[0].len != kernel->state_size ||
        (size_t)buffers[1].len != kernel->workspace_size ||
        (size_t)buffers[2].len != kernel->gains_size) {
        PyErr_SetString(PyExc_ValueError, "state or gains are not those of this kernel");
        return -1;
    }
    if ((size_t)buffers[3].len % kernel->sample_size != 0) {
        PyErr_SetString(PyExc_ValueError, "samples are not whole samples of this kernel");
        return -1;
    }
    const size_t rows = (size_t)buffers[3].len / kernel->sample_size;
    if ((size_t)buffers[4].len != rows * RESULT_COLUMNS * kernel->number_size) {
        PyErr_SetString(PyExc_ValueError, "results need one row of 10 numbers per sample");
        return -1;
    }
    return (Py_ssize_t)rows;
}

static PyObject *run(PyObject *self, PyObject *arguments)
{
    Py_buffer buffers[BUFFERS];
    int number = 0;
    (void)self;
    if (!PyArg_ParseTuple(arguments, "iw*w*y*y*w*", &number, &buffers[0], &buffers[1], &buffers[2],
                          &buffers[3], &buffers[4])) {
        return NULL;
    }
    Py_ssize_t rows = -1;
    int32_t bits = 0;
    if (number < 0 || number >= (int)KERNELS) {
        PyErr_SetString(PyExc_ValueError, "there is no kernel of this number");
    } else {
        rows = rows_of(kernels[number], buffers);
    }
    if (rows >= 0) {
        /* Other threads may run beside a batch; a single sample is shorter than the hand-over. */
        PyThreadState *thread = rows >= BATCH_ROWS ? PyEval_SaveThread() : NULL;
        bits = kernels[number]->run(buffers[0].buf, buffers[1].buf, buffers[2].buf, buffers[3].buf,
                                    (size_t)rows, buffers[4].buf);
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
    return PyLong_FromLong(bits);
}

static PyMethodDef methods[] = {
    {"run", run, METH_VARARGS, "Samples through the step of one kernel."},
    {"whiten", likelihood_whiten, METH_VARARGS, "Whitens columns."},
    {"products", likelihood_products, METH_VARARGS, "Scalar products of columns."},
    {"fit", likelihood_fit, METH_VARARGS, "Integrates unknowns out."},
    {"extend", likelihood_extend, METH_VARARGS, "Integrates further unknowns out."},
    {"unknowns", likelihood_unknowns, METH_VARARGS, "The most probable unknowns."},
    {"spread", likelihood_spread, METH_VARARGS, "What the covariance of unknowns is made of."},
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
    char codes[KERNELS + 1] = {0};
    for (size_t i = 0; i < KERNELS; i++) {
        codes[i] = kernels[i]->number_size == sizeof(double) ? 'd' : 'i';
    }
    PyObject *module = PyModule_Create(&definition);
    if (module != NULL &&
        (PyModule_AddStringConstant(module, "kernel_digest", KERNEL_DIGEST) != 0 ||
         PyModule_AddStringConstant(module, "number_codes", codes) != 0)) {
        Py_DECREF(module);
        return NULL;
    }
    return module;
}
