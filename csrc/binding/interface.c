/* SPDX-License-Identifier: BSD-3-Clause */
/* The rows of the table; docs/ and the Python layer say what arguments mean. */
#include "interface.h"

#include "py_functions.h"

const hs_argument HS_EVERY_SEARCH[HS_CALL_ARGUMENTS] = {
    {"points", HS_ARG_POINTS, NULL},
    {"cutoff", HS_ARG_CUTOFF, NULL},
    {"box", HS_ARG_BOX, NULL},
    {"periodic", HS_ARG_PERIODIC, NULL},
    {"inclusive", HS_ARG_INCLUSIVE, NULL},
    {"precision", HS_ARG_PRECISION, NULL},
    {"kernel", HS_ARG_KERNEL, NULL},
    {"memory_limit", HS_ARG_MEMORY_LIMIT, NULL},
    {"progress", HS_ARG_PROGRESS, NULL},
    {"threads", HS_ARG_THREADS, NULL},
};

/* What several take; letters of rows are none that say what the row is. */
static const hs_argument OF_SHELL_ROWS = {"quantities", HS_ARG_QUANTITIES, "jdDSk"},
                         OF_ROWS = {"quantities", HS_ARG_QUANTITIES, "jdDS"},
                         QUANTITIES = {"quantities", HS_ARG_QUANTITIES, "ijdDSP"},
                         OF_SHELLS = {"quantities", HS_ARG_QUANTITIES, HS_LETTERS},
                         MAX_PAIRS = {"max_pairs", HS_ARG_INTEGER, NULL},
                         SORT = {"sort", HS_ARG_SORT, NULL},
                         INDEX = {"index_dtype", HS_ARG_INDEX, NULL},
                         OUT = {"out", HS_ARG_OUT, NULL},
                         OTHER_POINTS = {"queries", HS_ARG_OTHER_POINTS, NULL},
                         QUERIES = {"queries", HS_ARG_QUERIES, NULL},
                         PAIRING = {"pairing", HS_ARG_PAIRING, NULL},
                         ALGORITHM = {"algorithm", HS_ARG_ALGORITHM, NULL},
                         SHELLS = {"shells", HS_ARG_SHELLS, NULL};

/* What one takes, or a few by this name. */
#define A(name, kind) (&(const hs_argument){name, kind, NULL})
#define OWN(name)     A(name, HS_ARG_OWN)
#define FLAG(name)    A(name, HS_ARG_FLAG)
#define INTEGER(name) A(name, HS_ARG_INTEGER)
#define REAL(name)    A(name, HS_ARG_REAL)
#define NODES         OWN("n_nodes"), OWN("n_ghosts"), OWN("number"), INTEGER("flags")
#define ROWS          OWN("offsets"), OWN("indices"), OWN("shifts")

const hs_function hs_functions[] = {
    {.name = "pairs",
     hs_py_pairs,
     {&OF_SHELLS, &SORT, &INDEX, &OUT, &PAIRING, &ALGORITHM, &SHELLS}},
    {.name = "count_pairs", hs_py_count_pairs, {&PAIRING, &ALGORITHM, &QUERIES}},
    {.name = "pairs_between",
     hs_py_pairs_between,
     {&OF_SHELLS, &SORT, &INDEX, &OUT, &OTHER_POINTS, &PAIRING, &ALGORITHM, &SHELLS}},
    {.name = "neighbors",
     hs_py_neighbors,
     {&OF_SHELL_ROWS, &INDEX, &QUERIES, &PAIRING, &ALGORITHM, &SHELLS}},
    {.name = "pairs_of_rows",
     hs_py_pairs_between,
     {&OF_SHELLS, &INDEX, &QUERIES, &PAIRING, &ALGORITHM, &SHELLS}},
    {.name = "coordination", hs_py_coordination, {&QUERIES, &PAIRING, &ALGORITHM}},
    {.name = "nearest", hs_py_nearest, {&OF_ROWS, &INDEX, &QUERIES, INTEGER("k"), &PAIRING}, true},
    {.name = "histogram",
     hs_py_histogram,
     {OWN("edges"), FLAG("last_inclusive"), &QUERIES, INTEGER("n_types"), &ALGORITHM, &PAIRING}},
    {.name = "clusters", hs_py_clusters, {OWN("core"), FLAG("winding"), &PAIRING, &ALGORITHM}},
    {.name = "iter_pairs",
     hs_py_iter_pairs,
     {&OF_SHELLS, &INDEX, &MAX_PAIRS, &PAIRING, &ALGORITHM, &SHELLS}},
    {.name = "for_each_pair",
     hs_py_for_each_pair,
     {OWN("callback"), OWN("user_data"), FLAG("thread_safe"), &PAIRING, &ALGORITHM}},
    {.name = "measure", hs_py_measure, {&OF_ROWS, OWN("i"), OWN("j"), OWN("S")}},
    {.name = "explain",
     hs_py_explain,
     {&OF_SHELLS, &SORT, &INDEX, FLAG("measure"), &PAIRING, &ALGORITHM, &SHELLS}},
    {.name = "cells_build", hs_py_cells_build, {REAL("cell_size"), OWN("domain")}},
    {.name = "cells_find", hs_py_cells_find, {&OTHER_POINTS}},
    {.name = "cells_candidates", hs_py_cells_candidates, {&QUERIES}},
    {.name = "verlet_update", hs_py_verlet_update, {OWN("list"), REAL("skin"), FLAG("rebuild")}},
    {.name = "verlet_pairs", hs_py_verlet_pairs, {OWN("list"), &QUANTITIES, &SORT, &INDEX, &OUT}},
    /* Rows are offsets, indices and, where there are any, shifts; nodes those of pairs. */
    {.name = "connect", hs_py_connect, {OWN("i"), OWN("j"), OWN("shifts"), NODES}},
    {.name = "connect_search", hs_py_connect_search, {NODES, &PAIRING}},
    {.name = "overlap", hs_py_overlap, {ROWS, NODES}},
    {.name = "intersect", hs_py_intersect, {OWN("i"), OWN("j"), OWN("shifts"), NODES}},
    {.name = "pair_rows", hs_py_pair_rows, {ROWS, NODES}},
    {.name = "keep_rows",
     hs_py_keep_rows,
     {ROWS, OWN("n_nodes"), OWN("target"), OWN("place"), OWN("source")}},
    {.name = "rows_without",
     hs_py_rows_without,
     {ROWS, OWN("offsets_without"), OWN("indices_without"), OWN("shifts_without"),
      INTEGER("n_lists"), FLAG("ascends")}},
    {.name = NULL},
};
