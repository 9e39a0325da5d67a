/* SPDX-License-Identifier: BSD-3-Clause */
/* groups.h: what the control groups of Linux leave this process of the memory. */
#ifndef HS_GROUPS_H
#define HS_GROUPS_H

/*
 * Bytes: the least that this process's group and any group above it still allows, in both versions
 * of control groups, as far as they are mounted here. Infinity where there is no limit, and on
 * other systems. `root` stands in for "/": "" for the machine itself, a folder for tests.
 */
double hs_group_memory(const char *root);

/* The number after `key` at the start of a line of the file; -1 when there is none. */
double hs_number_in_file(const char *path, const char *key);

#endif
