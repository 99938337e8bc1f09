#!/bin/sh
# Sound proof by Frama-C/EVA (Debian: frama-c-base) over the ranges of eva_driver.c: about half a minute.
# IEEE infinities are allowed (a bound may overflow, a step is then the rest of the view); nothing else is.
cd "$(dirname "$0")"
frama-c -eva -eva-precision 1 -eva-auto-loop-unroll 20 -eva-split-return full -eva-slevel-function cff_conflicts_begin:500,main:500,check:100,cff_check_path:100 -warn-special-float none -eva-no-show-progress -machdep x86_64 eva_driver.c ../src/*.c > ../results/eva.txt 2>&1
grep -A18 "ANALYSIS SUMMARY" ../results/eva.txt
grep -A1 "eva:alarm" ../results/eva.txt | grep -v "^--"
