/* One line per test file: MODULE(name) for test_<name>.c. */
MODULE(exact)
MODULE(doubleword)
MODULE(measure)
MODULE(filter)
MODULE(fpenv)
MODULE(reduce)
MODULE(rank)
