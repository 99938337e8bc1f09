#!/usr/bin/env bash
# Evidence about the library, one command a claim; each prints its figure and fails if the claim does.
# Usage: flight/tools/evidence.sh CLAIM [VECTORS], VECTORS the folder of `closeform flight-vectors`, CLAIM one of
#   static      cppcheck with its MISRA C:2012 addon, and gcc's analyzer (no VECTORS)
#   functions   no function is longer than 60 lines (no VECTORS)
#   sanitizers  golden vectors and a fuzzer's 100 000 inputs under AddressSanitizer and UndefinedBehaviorSanitizer
#   coverage    branches taken by golden vectors and the fuzzer, by gcov
#   inputs      a million adversarial inputs, nan and infinities included, within their budgets (no VECTORS)
#   fuzz        ten minutes of libFuzzer with sanitizers (no VECTORS)
set -euo pipefail
cd "$(dirname "$0")/.."
claim=$1
vectors=${2:-.}
vectors=$(cd "$OLDPWD" && cd "$vectors" && pwd)
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
flags="-std=gnu99 -ffp-contract=off -Iinclude -I$vectors"
sanitize="-g -O1 -fsanitize=address,undefined -fno-sanitize-recover=all"
case $claim in
static)
    # advisory rules that the library deviates from, with reasons in docs/on_board.md
    cppcheck --enable=all --inconclusive --std=c99 -Iinclude -Isrc --addon=misra --quiet --error-exitcode=1 \
        --suppress=missingIncludeSystem --suppress=unusedFunction --suppress=variableScope --suppress=misra-c2012-2.3 \
        --suppress=misra-c2012-2.5 --suppress=misra-c2012-8.7 --suppress=misra-c2012-8.9 --suppress=misra-c2012-12.1 src/*.c
    for file in src/*.c; do gcc -std=c99 -O2 -fanalyzer -Werror -Iinclude -c "$file" -o "$place/o"; done
    echo "cppcheck, MISRA C:2012 (required rules) and gcc -fanalyzer: no finding"
    ;;
functions)
    awk '/^{/ { start = FNR } /^}/ && start { if (FNR - start - 1 > 60) { print FILENAME ":" start; bad = 1 }; start = 0; count++ }
        END { print count " functions, none longer than 60 lines"; exit bad }' src/*.c
    ;;
sanitizers)
    gcc $flags $sanitize src/*.c tests/golden.c -lm -o "$place/golden" && "$place/golden"
    gcc $flags $sanitize -DCASES=100000 src/*.c tests/fuzz.c -lm -o "$place/fuzz" && "$place/fuzz"
    ;;
coverage)
    mkdir "$place/o"
    here=$PWD
    cd "$place/o"
    for file in "$here"/src/*.c; do gcc $flags -I"$here/include" -O0 --coverage -c "$file"; done
    for program in golden fuzz; do
        gcc $flags -I"$here/include" -O1 -DCASES=400000 --coverage -fno-profile-arcs -fno-test-coverage "$here/tests/$program.c" *.o -lm -o "../$program"
        "../$program" > /dev/null
    done
    gcov -b *.gcda | awk '/^File.*src\/cff/ { ours = 1 } /^Taken at least/ && ours { split($3, a, ":"); split($4, b, "%"); }
        /^Branches executed/ { } /^Taken at least/ && ours { match($0, /[0-9.]+%/); share = substr($0, RSTART, RLENGTH - 1);
        total = $NF; taken += share * total / 100; all += total; ours = 0 } END { printf "%.1f %% of %d branches taken\n", 100 * taken / all, all; exit taken < 0.95 * all }'
    ;;
inputs)
    gcc $flags -O2 -DCASES=1000000 src/*.c tests/fuzz.c -lm -o "$place/fuzz" && "$place/fuzz"
    ;;
fuzz)
    clang $flags -g -O1 -fsanitize=fuzzer,address,undefined -fno-sanitize-recover=all src/*.c tests/fuzz.c -lm -o "$place/fuzz"
    mkdir "$place/corpus"
    "$place/fuzz" -max_len=1024 -max_total_time=600 -timeout=60 -artifact_prefix="$place/" "$place/corpus" 2>&1 | tail -2
    ;;
*)
    sed -n 's/^# \{0,1\}//p' "$0" | head -10
    exit 2
    ;;
esac
