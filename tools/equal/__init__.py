"""Whether two versions of the program give the same outputs: `make equal BASE=COMMIT`."""
