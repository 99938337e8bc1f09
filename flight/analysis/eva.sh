#!/usr/bin/env bash
# Frama-C/EVA (Debian: frama-c-base) over the ranges of eva_driver.c, one entry point after the other: no access is
# invalid, nothing is read before it is written, no integer overflows.  The status is 0 without an alarm but the one
# that is explained: EVA does not see that the comparisons around a conversion to an integer exclude nan.
# IEEE infinities and nan are allowed: a bound may overflow, and a step is then the rest of the view.
# Usage: eva.sh [ENTRY...]; an entry that ends with + has paths beside a table.  LIMIT is in seconds.
# By name only: AVOID, whose counts EVA cannot bound, CIRCLE, which did not end in five minutes, and IMPULSES, not yet run.
cd "$(dirname "$0")"
entries=${*:-MOTION MOTION+ CONFLICTS CONFLICTS+ APPROACH APPROACH+ LOSS+ WINDOW+ SEARCH JOINS}
explained="cff_hill.c:[0-9]*: Warning: *non-finite double value"
apart=main:50,cff_gathering_begin:20,transfer:20,drift:20,cff_conflicts_begin:20,cfi_check_pair:20,look:20,cff_check_path:20
left=0
printf '%-12s %9s %8s  %s\n' entry functions seconds alarms
for entry in $entries; do
    options="-eva-precision 0 -eva-auto-loop-unroll 25 -eva-split-return full -eva-slevel-function $apart"
    defines="-D${entry%+}"
    sources=$(ls ../src/*.c)
    [[ $entry == *+ ]] && defines+=" -DBESIDE"
    case $entry in
    JOINS) options+=" -eva-auto-loop-unroll 64" ;;
    LOSS+) options+=" -eva-use-spec judge_window" ;; # whose body WINDOW+ analyses
    WINDOW+) sources=${sources/..\/src\/cff_passive.c/} ;;
    esac
    since=$SECONDS
    log=${TMPDIR:-/tmp}/eva_$entry.txt
    timeout "${LIMIT:-900}" frama-c -cpp-extra-args="-I../include -I../src $defines" -eva $options -warn-special-float none \
        -eva-no-show-progress -machdep x86_64 eva_driver.c $sources > "$log" 2>&1
    ended=$?
    alarms=$(grep -A1 "eva:alarm" "$log" | grep -v "^--" | paste -sd ' ' | sed 's/\[eva:alarm\] /\n/g' | sed '/^ *$/d; s/^.*\///; s/  */ /g')
    others=$(grep -v "$explained" <<< "$alarms" | grep -c .)
    functions=$(sed -n 's/^ *\([0-9]*\) functions analyzed.*/\1/p' "$log")
    if [[ $ended != 0 || -z $functions ]]; then
        printf '%-12s %9s %8s  not finished\n' "$entry" - $((SECONDS - since))
        left=1
    else
        printf '%-12s %9s %8s  %s\n' "$entry" "$functions" $((SECONDS - since)) "$(grep -c . <<< "$alarms") ($others unexplained)"
    fi
    [[ $others != 0 ]] && grep -v "$explained" <<< "$alarms" | sed 's/^/    /' && left=1
done
exit $left
