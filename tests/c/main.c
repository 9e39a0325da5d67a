/* SPDX-License-Identifier: BSD-3-Clause */
/* main.c: runs the C tests. Usage: core_tests [-t] [part of a test's name]; -t: times */
#include "support/harness.h"

int         harness_failures;
int         harness_tests;
const char *harness_filter;
bool        harness_times;

#define MODULE(name) void test_##name(void);
#include "modules.h"
#undef MODULE

int
main(int argc, char **argv)
{
    harness_times = argc > 1 && strcmp(argv[1], "-t") == 0;
    harness_filter = argc > 1 + harness_times ? argv[1 + harness_times] : NULL;
#define MODULE(name) test_##name();
#include "modules.h"
#undef MODULE
    printf("%d passed, %d failed\n", harness_tests, harness_failures);
    return harness_failures != 0 || harness_tests == 0;
}
