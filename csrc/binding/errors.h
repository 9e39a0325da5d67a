/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_ERRORS_H
#define HS_ERRORS_H

#include "numpy_api.h"

#include "../halfshell.h"

#include <stdbool.h>

/* Sets the exception for a status other than HS_OK; returns NULL for convenience.
 * HS_ERR_INTERRUPTED expects that poll() has set one. options may be NULL. */
PyObject *hs_raise(hs_status status, const hs_failure *failure, const hs_options *options);

/* Of HS_ERR_MEMORY: whether what was expected is within the limit, and more was taken. */
bool hs_took_more(const hs_failure *failure);

/* The shortest text that float() reads as this number; returns text. */
const char *hs_format_real(double value, char text[32]);

/* Bytes in the largest unit of which there is one, such as "1.5 GB". Returns text, of so many
 * bytes; 32 suffice, and 48 for the next. */
const char *hs_format_bytes(double bytes, char *text, size_t size);

/* What may be taken: "1.5 GB are allowed", or where nothing but the system sets a limit, "the
 * system has no more". */
const char *hs_format_limit(double bytes, char *text, size_t size);

/* Puts entry k into the tuple and gives it up; where it is NULL, the tuple is given up instead, and
 * *tuple is NULL. */
void hs_tuple_put(PyObject **tuple, Py_ssize_t k, PyObject *entry);

/* n names; a new reference, or NULL with an exception set. */
PyObject *hs_tuple_of_names(const char *const *names, int n);

#endif
