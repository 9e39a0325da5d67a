/* SPDX-License-Identifier: BSD-3-Clause */
/* The rows of the table; docs/ and the Python layer say what arguments mean. */
#include "interface.h"

#include "py_functions.h"

const hs_argument HS_EVERY_SEARCH[HS_CALL_ARGUMENTS] = {
    {"points", HS_ARG_POINTS, NULL},
    {"cutoff", HS_ARG_CUTOFF, "None"},
    {"box", HS_ARG_BOX, "None"},
    {"periodic", HS_ARG_PERIODIC, "None"},
    {"inclusive", HS_ARG_INCLUSIVE, "True"},
    {"precision", HS_ARG_PRECISION, "'exact'"},
    {"kernel", HS_ARG_KERNEL, "None"},
    {"memory_limit", HS_ARG_MEMORY_LIMIT, "None"},
    {"progress", HS_ARG_PROGRESS, "None"},
    {"threads", HS_ARG_THREADS, "None"},
};

const hs_argument HS_MAX_DISTANCE = {"max_distance", HS_ARG_MAX_DISTANCE, "inf"};

const hs_argument HS_ONLY_PYTHON[] = {
    {"rule", HS_ARG_OWN, "None"},         {"exclude", HS_ARG_OWN, "None"},
    {"min_distance", HS_ARG_OWN, "None"}, {"indices", HS_ARG_OWN, "None"},
    {"by_type", HS_ARG_OWN, "False"},     {NULL, HS_ARG_END, NULL},
};

#define QUANTITIES                              \
    {                                           \
        "quantities", HS_ARG_QUANTITIES, "'ij'" \
    }
#define OF_SHELLS                                     \
    {                                                 \
        "quantities", HS_ARG_SHELL_QUANTITIES, "'ij'" \
    }
#define OF_ROWS                                    \
    {                                              \
        "quantities", HS_ARG_ROW_QUANTITIES, "'j'" \
    }
#define SORT                         \
    {                                \
        "sort", HS_ARG_SORT, "False" \
    }
#define SORTED                      \
    {                               \
        "sort", HS_ARG_SORT, "True" \
    }
#define INDEX                                      \
    {                                              \
        "index_dtype", HS_ARG_INDEX, "numpy.int64" \
    }
#define OUT                       \
    {                             \
        "out", HS_ARG_OUT, "None" \
    }
#define OTHER_POINTS                         \
    {                                        \
        "queries", HS_ARG_OTHER_POINTS, NULL \
    }
#define QUERIES                           \
    {                                     \
        "queries", HS_ARG_QUERIES, "None" \
    }
#define REACH                         \
    {                                 \
        "reach", HS_ARG_REACH, "None" \
    }
#define ALGORITHM                               \
    {                                           \
        "algorithm", HS_ARG_ALGORITHM, "'auto'" \
    }
#define SHELLS                          \
    {                                   \
        "shells", HS_ARG_SHELLS, "None" \
    }
#define CAPACITY                            \
    {                                       \
        "capacity", HS_ARG_CAPACITY, "None" \
    }
#define BATCH                         \
    {                                 \
        "batch", HS_ARG_BATCH, "None" \
    }
#define OWN(name)              \
    {                          \
        name, HS_ARG_OWN, NULL \
    }
#define FLAG(name)              \
    {                           \
        name, HS_ARG_FLAG, NULL \
    }
#define INTEGER(name)              \
    {                              \
        name, HS_ARG_INTEGER, NULL \
    }
#define REAL(name)              \
    {                           \
        name, HS_ARG_REAL, NULL \
    }
#define NODES OWN("n_nodes"), OWN("n_ghosts"), OWN("number"), INTEGER("flags")
#define ROWS  OWN("offsets"), OWN("indices"), OWN("shifts")

/* What users give. */
#define SCENE "box", "periodic", "rule", "exclude", "min_distance"
#define HOW   "threads", "progress"

const hs_function hs_functions[HS_FUNCTIONS] = {
    [HS_FN_PAIRS] = {"pairs",
                     hs_py_pairs,
                     {OF_SHELLS, SORT, INDEX, OUT, REACH, ALGORITHM, SHELLS, CAPACITY, BATCH},
                     {"points", "cutoff", "*", SCENE, "indices", "inclusive", "quantities",
                      "index_dtype", "sort", "out", HOW}},
    [HS_FN_COUNT_PAIRS] = {"count_pairs",
                           hs_py_count_pairs,
                           {REACH, ALGORITHM, QUERIES, BATCH},
                           {"points", "cutoff", "*", "queries", SCENE, "indices", "inclusive",
                            HOW}},
    [HS_FN_PAIRS_BETWEEN] = {"pairs_between",
                             hs_py_pairs_between,
                             {OF_SHELLS, SORTED, INDEX, OUT, OTHER_POINTS, REACH, ALGORITHM, SHELLS,
                              CAPACITY, BATCH},
                             {"queries", "points", "cutoff", "*", SCENE, "inclusive", "quantities",
                              "index_dtype", "out", HOW}},
    [HS_FN_NEIGHBORS] = {"neighbors",
                         hs_py_neighbors,
                         {{"quantities", HS_ARG_SHELL_ROW_QUANTITIES, "'j'"},
                          INDEX,
                          QUERIES,
                          REACH,
                          ALGORITHM,
                          SHELLS,
                          BATCH},
                         {"points", "cutoff", "*", "queries", SCENE, "indices", "inclusive",
                          "quantities", "index_dtype", HOW}},
    [HS_FN_COORDINATION] = {"coordination",
                            hs_py_coordination,
                            {QUERIES, REACH, ALGORITHM, BATCH},
                            {"points", "cutoff", "*", "queries", SCENE, "indices", "inclusive",
                             "by_type", HOW}},
    [HS_FN_NEAREST] = {"nearest",
                       hs_py_nearest,
                       {{"quantities", HS_ARG_ROW_QUANTITIES, "'jd'"},
                        INDEX,
                        QUERIES,
                        INTEGER("k"),
                        REACH,
                        BATCH},
                       {"points", "k", "*", "max_distance", "queries", "box", "periodic", "exclude",
                        "min_distance", "indices", "inclusive", "quantities", "index_dtype", HOW},
                       true},
    [HS_FN_HISTOGRAM] = {"histogram",
                         hs_py_histogram,
                         {OWN("edges"), FLAG("last_inclusive"), QUERIES, INTEGER("n_types"),
                          OWN("types"), OWN("weights"), OWN("query_types"), OWN("query_weights"),
                          ALGORITHM, REACH, BATCH}},
    [HS_FN_CLUSTERS] = {"clusters",
                        hs_py_clusters,
                        {OWN("core"), FLAG("winding"), REACH, ALGORITHM}},
    [HS_FN_ITER_PAIRS] =
        {"iter_pairs",
         hs_py_iter_pairs,
         {OF_SHELLS, INDEX, {"max_pairs", HS_ARG_INTEGER, "1048576"}, REACH, ALGORITHM, SHELLS},
         {"points", "cutoff", "*", SCENE, "indices", "inclusive", "quantities", "index_dtype",
          "max_pairs", HOW}},
    [HS_FN_FOR_EACH_PAIR] = {"for_each_pair",
                             hs_py_for_each_pair,
                             {OWN("callback"), OWN("user_data"), FLAG("thread_safe"),
                              INTEGER("first"), REACH, ALGORITHM}},
    [HS_FN_MEASURE] = {"measure", hs_py_measure, {OF_ROWS, OWN("i"), OWN("j"), OWN("S")}},
    [HS_FN_EXPLAIN] = {"explain",
                       hs_py_explain,
                       {OF_SHELLS, SORT, INDEX, FLAG("measure"), REACH, ALGORITHM, SHELLS}},
    [HS_FN_CELLS_BUILD] = {"cells_build", hs_py_cells_build, {REAL("cell_size"), OWN("domain")}},
    [HS_FN_CELLS_CANDIDATES] = {"cells_candidates", hs_py_cells_candidates, {QUERIES}},
    [HS_FN_VERLET_UPDATE] = {"verlet_update", hs_py_verlet_update, {REAL("skin"), FLAG("rebuild")}},
    [HS_FN_VERLET_PAIRS] = {"verlet_pairs", hs_py_verlet_pairs, {QUANTITIES, SORT, INDEX, OUT}},
    /* Rows are offsets, indices and, where there are any, shifts; nodes those of pairs. */
    [HS_FN_CONNECT] = {"connect", hs_py_connect, {OWN("i"), OWN("j"), OWN("shifts"), NODES}},
    [HS_FN_CONNECT_SEARCH] = {"connect_search", hs_py_connect_search, {NODES, REACH}},
    [HS_FN_OVERLAP] = {"overlap", hs_py_overlap, {ROWS, NODES}},
    [HS_FN_INTERSECT] = {"intersect", hs_py_intersect, {OWN("i"), OWN("j"), OWN("shifts"), NODES}},
    [HS_FN_PAIR_ROWS] = {"pair_rows", hs_py_pair_rows, {ROWS, NODES}},
    [HS_FN_KEEP_ROWS] = {"keep_rows",
                         hs_py_keep_rows,
                         {ROWS, OWN("n_nodes"), OWN("target"), OWN("place"), OWN("source")}},
    [HS_FN_ROWS_WITHOUT] = {"rows_without",
                            hs_py_rows_without,
                            {ROWS, OWN("offsets_without"), OWN("indices_without"),
                             OWN("shifts_without"), INTEGER("n_lists"), FLAG("ascends")}},
};
