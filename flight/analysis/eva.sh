#!/bin/sh
# Frama-C/EVA (Debian: frama-c-base) over the ranges of eva_driver.c, one entry point after the other.
# IEEE infinities and nan are allowed: a bound may overflow, and a step is then the rest of the view.
# Usage: eva.sh [ENTRY...], of MOTION, CONFLICTS, AVOID and LOSS; with BESIDE=1 beside a table.
cd "$(dirname "$0")"
for entry in ${*:-MOTION CONFLICTS AVOID LOSS}; do
    echo "== $entry${BESIDE:+ beside a table}"
    timeout ${LIMIT:-900} frama-c -cpp-extra-args="-I../include -D$entry ${BESIDE:+-DBESIDE}" -eva -eva-precision 1 -eva-auto-loop-unroll 40 -eva-split-return full -eva-slevel-function cff_conflicts_begin:500,main:300,cfi_check_pair:100,cff_check_path:100 -warn-special-float none \
        -eva-no-show-progress -machdep x86_64 eva_driver.c ../src/*.c > "/tmp/eva_$entry$BESIDE.txt" 2>&1 || echo "not finished within the time"
    grep -A14 "ANALYSIS SUMMARY" "/tmp/eva_$entry$BESIDE.txt"
    grep -A1 "eva:alarm" "/tmp/eva_$entry$BESIDE.txt" | grep -v "^--"
done
