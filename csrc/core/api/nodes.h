/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_API_NODES_H
#define HS_API_NODES_H

#include "../connectivity/connectivity.h"
#include "pairs.h"

/*
 * nodes.h: the functions of halfshell_nodes.h: connectivity of node lists, its changes and its
 * geometry.
 */

/* How the functions of node lists begin and end. */

#endif
