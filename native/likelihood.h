/* The arithmetic of integrity/normal_equations.py and composition.py, under their names. */
#ifndef H2NAV_LIKELIHOOD_H
#define H2NAV_LIKELIHOOD_H

#define PY_SSIZE_T_CLEAN
#include <Python.h>

PyObject *likelihood_whiten(PyObject *self, PyObject *arguments);
PyObject *likelihood_products(PyObject *self, PyObject *arguments);
PyObject *likelihood_fit(PyObject *self, PyObject *arguments);
PyObject *likelihood_extend(PyObject *self, PyObject *arguments);
PyObject *likelihood_likelihoods(PyObject *self, PyObject *arguments);
PyObject *likelihood_unknowns(PyObject *self, PyObject *arguments);
PyObject *likelihood_spread(PyObject *self, PyObject *arguments);
PyObject *likelihood_compose(PyObject *self, PyObject *arguments);

#endif
