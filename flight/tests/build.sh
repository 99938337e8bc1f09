#!/bin/sh
# Shared libraries for the comparison: with libm's trigonometry (bit for bit Python's) and with the core's own.
set -e
cd "$(dirname "$0")/.."
mkdir -p build
F="-std=c99 -O2 -ffp-contract=off -fPIC -shared -Iinclude -Wall -Wextra"
gcc $F -DCFF_LIBM_TRIGONOMETRY src/*.c tests/bridge.c -lm -o build/libcff_libm.so
gcc $F src/*.c tests/bridge.c -lm -o build/libcff_own.so
