/* The right-hand side of the pendulum as a function of Python that runs no Python, for the integrators of SciPy that
 * take nothing else: f(t, y) writes the derivatives of y = (phi, w) into one array and returns that. */

#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <math.h>
#include <stdlib.h>

typedef struct {
    double k2, w02, held;          /* [1/s], [1/s2], constant drive [1/s2] */
    double peak, center, variance; /* of a Gaussian drive: [1/s2], [s], [s2]; no drive where the peak is 0 */
    PyObject *result;
    double *derivatives; /* the numbers of `result` */
} Equation;

static void free_equation(PyObject *capsule) {
    Equation *e = PyCapsule_GetPointer(capsule, NULL);
    Py_DECREF(e->result);
    free(e);
}

static PyObject *evaluate(PyObject *capsule, PyObject *const *arguments, Py_ssize_t n) {
    Equation *e = PyCapsule_GetPointer(capsule, NULL);
    Py_buffer state;
    if (n != 2) {
        PyErr_SetString(PyExc_TypeError, "f(t, y) takes 2 arguments");
        return NULL;
    }
    if (PyObject_GetBuffer(arguments[1], &state, PyBUF_SIMPLE) != 0) return NULL;
    const double *y = state.buf;
    double a = e->held - e->k2 * y[1] - e->w02 * sin(y[0]);
    if (e->peak != 0.0) {
        const double from_center = PyFloat_AsDouble(arguments[0]) - e->center;
        a += e->peak * exp(-from_center * from_center / (2 * e->variance));
    }
    e->derivatives[0] = y[1];
    e->derivatives[1] = a;
    PyBuffer_Release(&state);
    Py_INCREF(e->result);
    return e->result;
}

static PyMethodDef EVALUATE = {"f", (PyCFunction)(void (*)(void))evaluate, METH_FASTCALL, NULL};

/* function(result, k2, w02, held, peak, center, variance): `result` is a writable array of two doubles. */
static PyObject *function(PyObject *module, PyObject *arguments) {
    Equation values;
    (void)module;
    if (!PyArg_ParseTuple(arguments, "Odddddd", &values.result, &values.k2, &values.w02, &values.held, &values.peak,
                          &values.center, &values.variance))
        return NULL;
    Py_buffer buffer;
    if (PyObject_GetBuffer(values.result, &buffer, PyBUF_WRITABLE) != 0) return NULL;
    values.derivatives = buffer.buf;
    PyBuffer_Release(&buffer); /* the array stays as long as the function */
    Equation *e = malloc(sizeof *e);
    if (e == NULL) return PyErr_NoMemory();
    *e = values;
    Py_INCREF(e->result);
    PyObject *capsule = PyCapsule_New(e, NULL, free_equation);
    PyObject *f = PyCFunction_New(&EVALUATE, capsule);
    Py_XDECREF(capsule);
    return f;
}

static PyMethodDef METHODS[] = {{"function", function, METH_VARARGS, NULL}, {NULL, NULL, 0, NULL}};
static struct PyModuleDef MODULE = {
    PyModuleDef_HEAD_INIT, "right_hand_side", NULL, -1, METHODS, NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit_right_hand_side(void);

PyMODINIT_FUNC PyInit_right_hand_side(void) {
    return PyModule_Create(&MODULE);
}
