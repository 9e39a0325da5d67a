/* SPDX-License-Identifier: BSD-3-Clause */
/* foreign.c: arrays of other libraries, by the protocols that they share. */
#include "foreign.h"

#include <math.h>

#define SHOWN 80 /* characters of a value in a message */

/* The exception that is set, taken; NULL where it is not the fault of an argument. */
static PyObject *
take_fault(void)
{
    PyObject *type, *value, *trace;
    if (!PyErr_ExceptionMatches(PyExc_Exception) || PyErr_ExceptionMatches(PyExc_MemoryError)) {
        return NULL;
    }
    PyErr_Fetch(&type, &value, &trace);
    PyErr_NormalizeException(&type, &value, &trace);
    if (trace != NULL) {
        PyException_SetTraceback(value, trace);
    }
    Py_XDECREF(type);
    Py_XDECREF(trace);
    return value;
}

/* Makes an exception the cause of the one that is set; takes ownership of it. */
static void
set_cause(PyObject *cause)
{
    PyObject *type, *value, *trace;
    PyErr_Fetch(&type, &value, &trace);
    PyErr_NormalizeException(&type, &value, &trace);
    PyException_SetCause(value, cause);
    PyErr_Restore(type, value, trace);
}

/* The text with one blank for each run of blanks and line breaks; takes ownership. NULL with an
 * exception set, also for NULL. */
static PyObject *
on_one_line(PyObject *text)
{
    PyObject *words = text != NULL ? PyUnicode_Split(text, NULL, -1) : NULL;
    PyObject *blank = words != NULL ? PyUnicode_FromString(" ") : NULL;
    PyObject *joined = blank != NULL ? PyUnicode_Join(blank, words) : NULL;
    Py_XDECREF(blank);
    Py_XDECREF(words);
    Py_XDECREF(text);
    return joined;
}

void
hs_refuse(PyObject *type, const char *must, PyObject *object)
{
    PyObject *text = on_one_line(PyObject_Repr(object));
    if (text == NULL) {
        PyObject *fault = take_fault();
        if (fault == NULL) {
            return;
        }
        Py_DECREF(fault);
        PyErr_Format(type, "%s, got a value of type %.80s", must, Py_TYPE(object)->tp_name);
        return;
    }
    if (PyUnicode_GetLength(text) > SHOWN) {
        Py_SETREF(text, PyUnicode_Substring(text, 0, SHOWN - 3));
        if (text != NULL) {
            PyErr_Format(type, "%s, got %U...", must, text);
        }
    } else {
        PyErr_Format(type, "%s, got %U", must, text);
    }
    Py_XDECREF(text);
}

/* Replaces what a conversion raised by a TypeError that says what the object must be. */
static bool
refuse_kind(const char *must, PyObject *object)
{
    PyObject *fault = take_fault();
    if (fault != NULL) {
        PyErr_Format(PyExc_TypeError, "%s, got %.80s", must, Py_TYPE(object)->tp_name);
        set_cause(fault);
    }
    return false;
}

bool
hs_whole_of(PyObject *object, const char *must, double *value)
{
    if (PyBool_Check(object)) {
        hs_refuse(PyExc_TypeError, must, object);
        return false;
    }
    PyObject *index = PyNumber_Index(object);
    if (index == NULL) {
        return refuse_kind(must, object);
    }
    int             overflow;
    const long long whole = PyLong_AsLongLongAndOverflow(index, &overflow);
    *value = (double)whole;
    if (overflow != 0) {
        *value = PyLong_AsDouble(index);
        if (PyErr_Occurred()) { /* an OverflowError: there is no other reason */
            PyErr_Clear();
            *value = overflow * (double)INFINITY;
        }
    }
    Py_DECREF(index);
    return true;
}

bool
hs_real_of(PyObject *object, const char *must, double *value)
{
    if (PyFloat_Check(object)) {
        *value = PyFloat_AS_DOUBLE(object);
        return true;
    }
    if (PyArray_IsScalar(object, Floating)) {
        *value = PyFloat_AsDouble(object);
        return PyErr_Occurred() ? refuse_kind(must, object) : true;
    }
    if (!hs_whole_of(object, must, value)) {
        return false;
    }
    if (isinf(*value)) {
        PyErr_Format(PyExc_OverflowError, "%s, got one that is too large for float64", must);
        return false;
    }
    return true;
}
