/* Python's door to the compiled kernels: buffers in, buffers out, nothing allocated.
 *
 * run(kernel, state, workspace, gains, samples, results)
 *   kernel     its number
 *   state      writable buffer: what the kernel remembers, changed in place
 *   workspace  writable buffer: where it works out a step; empty for a kernel that needs none
 *   gains      buffer: its gains
 *   samples    buffer: samples, one behind the other
 *   results    writable buffer, one row of 13 numbers per sample: attitude, bias, bits,
 *              and, of kernels that have them, deviations of tilt and heading, whether a velocity
 *              holds the attitude, and the velocity gained since
 * It returns the bits of the last sample.
 *
 * bind(kernel, state, workspace, gains, sample, first, count), of kernels of doubles: a function of
 * `count` numbers, which writes them into the sample from number `first` on, processes it and
 * returns bits. It holds the buffers: a step costs half of what `run` takes.
 *
 * interface is raised with every change of what is offered here (attitude/native.py expects one);
 * kernel_digest tells which version of the Python kernels the C was translated from, number_codes
 * of each kernel whether its numbers are doubles (d) or 32-bit integers (i).
 */
#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <string.h>

#include "kernels.h"
#include "likelihood.h"

static const struct kernel *const kernels[] = {KERNELS_IN_ORDER};

enum {
    INTERFACE = 3,
    RESULT_COLUMNS = 13,
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
        PyErr_SetString(PyExc_ValueError, "results need one row of numbers per sample");
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

enum { OF_BOUND = 4 };

struct bound {
    PyObject_HEAD
    const struct kernel *kernel;
    Py_buffer buffers[OF_BOUND];
    Py_ssize_t first, count;
};

static PyObject *bound_call(PyObject *self, PyObject *arguments, PyObject *keywords)
{
    struct bound *bound = (struct bound *)self;
    double *sample = bound->buffers[3].buf;
    double result[RESULT_COLUMNS];
    (void)keywords;
    if (PyTuple_Size(arguments) != bound->count) {
        PyErr_SetString(PyExc_TypeError, "not as many numbers as fields");
        return NULL;
    }
    for (Py_ssize_t i = 0; i < bound->count; i++) {
        const double number = PyFloat_AsDouble(PyTuple_GetItem(arguments, i));
        if (number == -1.0 && PyErr_Occurred() != NULL) {
            return NULL;
        }
        sample[bound->first + i] = number;
    }
    return PyLong_FromLong(bound->kernel->run(bound->buffers[0].buf, bound->buffers[1].buf,
                                              bound->buffers[2].buf, sample, 1, result));
}

static void bound_free(PyObject *self)
{
    struct bound *bound = (struct bound *)self;
    PyTypeObject *type = Py_TYPE(self);
    for (int i = 0; i < OF_BOUND; i++) {
        PyBuffer_Release(&bound->buffers[i]);
    }
    PyObject_Free(self);
    Py_DECREF(type);
}

static PyType_Slot bound_slots[] = {
    {Py_tp_call, bound_call},
    {Py_tp_dealloc, bound_free},
    {0, NULL},
};

static PyType_Spec bound_spec = {
    .name = "h2nav.attitude._native.Bound",
    .basicsize = sizeof(struct bound),
    .flags = Py_TPFLAGS_DEFAULT | Py_TPFLAGS_DISALLOW_INSTANTIATION,
    .slots = bound_slots,
};

static PyTypeObject *bound_type;

static PyObject *bind(PyObject *self, PyObject *arguments)
{
    int number = 0;
    Py_buffer b[OF_BOUND];
    Py_ssize_t first = 0, count = 0;
    (void)self;
    if (!PyArg_ParseTuple(arguments, "iw*w*y*w*nn", &number, &b[0], &b[1], &b[2], &b[3], &first,
                          &count)) {
        return NULL;
    }
    struct bound *bound = NULL;
    const struct kernel *kernel = NULL;
    if (number >= 0 && number < (int)KERNELS) {
        kernel = kernels[number];
    }
    if (kernel == NULL || kernel->number_size != sizeof(double) ||
        (size_t)b[0].len != kernel->state_size || (size_t)b[1].len != kernel->workspace_size ||
        (size_t)b[2].len != kernel->gains_size || (size_t)b[3].len != kernel->sample_size ||
        first < 0 || count < 0 ||
        (size_t)first + (size_t)count > kernel->sample_size / sizeof(double)) {
        PyErr_SetString(PyExc_ValueError, "these are not the records of a kernel of doubles");
    } else {
        bound = PyObject_New(struct bound, bound_type);
    }
    if (bound == NULL) {
        for (int i = 0; i < OF_BOUND; i++) {
            PyBuffer_Release(&b[i]);
        }
        return NULL;
    }
    bound->kernel = kernel;
    memcpy(bound->buffers, b, sizeof b);
    bound->first = first;
    bound->count = count;
    return (PyObject *)bound;
}

static PyMethodDef methods[] = {
    {"run", run, METH_VARARGS, "Samples through the step of one kernel."},
    {"bind", bind, METH_VARARGS, "A function that steps one kernel with given numbers."},
    {"whiten", likelihood_whiten, METH_VARARGS, "Whitens columns."},
    {"products", likelihood_products, METH_VARARGS, "Scalar products of columns."},
    {"fit", likelihood_fit, METH_VARARGS, "Integrates unknowns out."},
    {"extend", likelihood_extend, METH_VARARGS, "Integrates further unknowns out."},
    {"likelihoods", likelihood_likelihoods, METH_VARARGS, "Likelihoods with further unknowns."},
    {"unknowns", likelihood_unknowns, METH_VARARGS, "The most probable unknowns."},
    {"spread", likelihood_spread, METH_VARARGS, "What the covariance of unknowns is made of."},
    {"compose", likelihood_compose, METH_VARARGS, "Rows to the columns of a window."},
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
    bound_type = (PyTypeObject *)PyType_FromSpec(&bound_spec);
    PyObject *module = bound_type == NULL ? NULL : PyModule_Create(&definition);
    if (module != NULL &&
        (PyModule_AddStringConstant(module, "kernel_digest", KERNEL_DIGEST) != 0 ||
         PyModule_AddIntConstant(module, "interface", INTERFACE) != 0 ||
         PyModule_AddStringConstant(module, "number_codes", codes) != 0)) {
        Py_DECREF(module);
        return NULL;
    }
    return module;
}
