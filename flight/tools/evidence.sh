#!/usr/bin/env bash
# Evidence about the library: a row for each claim, with its figure.  The status is 0 if all of them hold.
# Usage: flight/tools/evidence.sh VECTORS [CLAIM...], VECTORS the folder of `closeform flight-vectors`, CLAIM some of
#   warnings    gcc and clang warn of nothing in the library as one file
#   static      cppcheck with its MISRA C:2012 addon, and gcc's analyzer
#   functions   no function is longer than 60 lines
#   sanitizers  golden vectors and a fuzzer's 100 000 inputs under AddressSanitizer and UndefinedBehaviorSanitizer
#   coverage    branches taken by golden vectors and the fuzzer, by gcov
#   inputs      a million adversarial inputs, nan and infinities included, within their budgets
#   mutants     changed operators that golden vectors or the fuzzer notice (mutants.py, five minutes)
#   digest      one digest on several instruction sets (digest.sh, needs QEMU and cross compilers)
#   eva         no invalid access, by Frama-C/EVA (analysis/eva.sh, ten minutes)
#   fuzz        ten minutes of libFuzzer with sanitizers
# Without CLAIM all of them, those that take long last.
set -uo pipefail
here=$(cd "$(dirname "$0")/.." && pwd)
vectors=$(cd "${1:?the folder of golden vectors}" && pwd)
shift
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
cp -r "$here" "$place/flight" && cd "$place/flight" # one state of the sources
flags="-std=gnu99 -ffp-contract=off -Iinclude -I$vectors"
sanitize="-g -O1 -fsanitize=address,undefined -fno-sanitize-recover=all"

warnings() {
    python3 tools/amalgamate.py one
    for compiler in gcc clang; do
        $compiler -std=c99 -O2 -Wall -Wextra -Wconversion -Wshadow -Wmissing-prototypes -pedantic -Werror -c one/closeform_flight.c -o o || return 1
    done
    echo "none by gcc $(gcc -dumpversion) and clang $(clang -dumpversion)"
}

static() { # advisory rules that the library deviates from are suppressed; docs/on_board.md has the reasons
    cppcheck --enable=all --inconclusive --std=c99 -Iinclude -Isrc --addon=misra --quiet --error-exitcode=1 \
        --suppress=missingIncludeSystem --suppress=unusedFunction --suppress=variableScope --suppress=misra-c2012-2.3 \
        --suppress=misra-c2012-2.5 --suppress=misra-c2012-8.7 --suppress=misra-c2012-8.9 --suppress=misra-c2012-12.1 src/*.c || return 1
    for file in src/*.c; do gcc -std=c99 -O2 -fanalyzer -Werror -Iinclude -c "$file" -o o || return 1; done
    echo "no finding by cppcheck, of MISRA C:2012 (required rules) and by gcc -fanalyzer"
}

functions() {
    awk '/^{/ { start = FNR } /^}/ && start { lines = FNR - start - 1; start = 0; count++; if (lines > most) { most = lines } }
        END { print count " functions, the longest has " most " lines"; exit most > 60 }' src/*.c
}

sanitizers() {
    gcc $flags $sanitize src/*.c tests/golden.c -lm -o golden && ./golden || return 1
    gcc $flags $sanitize -DCASES=100000 src/*.c tests/fuzz.c -lm -o fuzz && ./fuzz || return 1
    echo "no finding"
}

coverage() {
    mkdir o
    for file in src/*.c; do gcc $flags -O0 --coverage -c "$file" -o "o/$(basename "$file" .c).o" || return 1; done
    for program in golden fuzz; do
        gcc $flags -O1 -DCASES=150000 "tests/$program.c" o/*.o --coverage -fno-profile-arcs -fno-test-coverage -lm -o $program || return 1
        ./$program > "$program.txt"
    done
    gcov -b o/*.gcda | awk -F"[:' ]+" '/^File/ { ours = /src\/cff/ } /^Taken at least/ && ours {
            split($0, part, /[:%]/); total = $NF; all += total; taken += part[2] * total / 100 }
        END { printf "%.1f %% of %d branches are taken\n", 100 * taken / all, all; exit taken < 0.95 * all }'
}

inputs() { gcc $flags -O2 -DCASES=1000000 src/*.c tests/fuzz.c -lm -o fuzz && ./fuzz; }

mutants() { python3 tools/mutants.py "$vectors"; }

digest() { tools/digest.sh "$vectors" && echo "one digest where compilers are"; }

eva() { TMPDIR=$place analysis/eva.sh && echo "no unexplained alarm"; }

fuzz() {
    clang $flags -g -O1 -fsanitize=fuzzer,address,undefined -fno-sanitize-recover=all src/*.c tests/fuzz.c -lm -o fuzz || return 1
    mkdir corpus
    ./fuzz -max_len=1024 -max_total_time=600 -timeout=60 -artifact_prefix="$place/" corpus 2>&1 | tail -2
}

failed=0
printf '%-11s %-6s %7s  %s\n' claim holds seconds figure
for claim in ${*:-warnings functions static sanitizers coverage inputs mutants digest eva fuzz}; do
    [[ $(type -t "$claim") == function ]] || { sed -n "2,/^set/{/^set/d;s/^# \\{0,1\\}//p}" "$here/tools/evidence.sh"; exit 2; }
    since=$SECONDS
    (cd "$place/flight" && "$claim") > "$place/log" 2>&1 && holds=yes || { holds=no; failed=1; }
    printf '%-11s %-6s %7s  %s\n' "$claim" $holds $((SECONDS - since)) "$(grep . "$place/log" | tail -1)"
    { [[ $holds == no ]] || [[ " mutants digest eva " == *" $claim "* ]]; } && sed '$d; s/^/    /' "$place/log"
done
exit $failed
