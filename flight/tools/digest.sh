#!/usr/bin/env bash
# Replay the golden vectors on several instruction sets under QEMU; every machine must give the same digest.
# Usage: flight/tools/digest.sh VECTORS (the folder of `closeform flight-vectors`); needs qemu-user and the compilers
# below; a target without its compiler is skipped. The status is 0 if at least two targets ran, and all agree. The
# software double precision of a Cortex-M4 is held to the tolerances of golden.c only: it rounds some last bits differently.
set -euo pipefail
vectors=$(cd "$1" && pwd)
cd "$(dirname "$0")/.."
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
cp -r src include tests "$place" && cd "$place" # one state of the sources
flags="-std=gnu99 -ffp-contract=off -fno-math-errno -Iinclude -I$vectors"
digest=""
ran=0
failed=0
while IFS='|' read -r label compiler run libraries; do
    if ! command -v "${compiler%% *}" > /dev/null || { [[ $run ]] && ! command -v "${run%% *}" > /dev/null; }; then
        printf '%-34s skipped: needs %s %s\n' "$label" "${compiler%% *}" "${run%% *}"
        continue
    fi
    expected=${digest:+-DDIGEST=0x${digest}U}
    [[ $label == *tolerances ]] && expected=""
    $compiler $flags $expected src/*.c tests/golden.c $libraries -o "$place/golden"
    if answer=$($run "$place/golden"); then
        digest=${digest:-$(sed -n 's/^digest //p' <<< "$answer")}
        [[ $label == *tolerances ]] && printf '%s\n' "$label" || printf '%-34s %s\n' "$label" "$digest"
    else
        printf '%-34s differs\n%s\n' "$label" "$answer"
        failed=1
    fi
    ran=$((ran + 1))
done << 'END'
x86-64 -O2|gcc -O2||-lm
x86-64 -O0|gcc -O0||-lm
x86-64 -O3 -march=native|gcc -O3 -march=native||-lm
x86-64 clang -O2|clang -O2||-lm
ARMv7|arm-linux-gnueabihf-gcc -O2|qemu-arm|-static -lm
Cortex-M7, Thumb-2, no libc|arm-none-eabi-gcc -O2 -mcpu=cortex-m7 -mthumb -mfloat-abi=hard -mfpu=fpv5-d16 -DCFF_FREESTANDING|qemu-arm -cpu max|-nostartfiles tests/start_thumb.c -lm --specs=nosys.specs
Cortex-M4, software double, no libc: within tolerances|arm-none-eabi-gcc -O2 -mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16 -DCFF_FREESTANDING|qemu-arm -cpu max|-nostartfiles tests/start_thumb.c -lm --specs=nosys.specs
AArch64|aarch64-linux-gnu-gcc -O2|qemu-aarch64|-static -lm
RV64GC|riscv64-linux-gnu-gcc -O2|qemu-riscv64|-static -lm
SPARC64|sparc64-linux-gnu-gcc -O2|qemu-sparc64|-static -lm
LEON3, SPARC v8, no libc|sparc64-linux-gnu-gcc -O2 -m32 -mcpu=leon3 -fno-tree-loop-distribute-patterns -fno-pie -no-pie -DCFF_FREESTANDING|qemu-sparc -cpu LEON3|-nostdlib -static tests/start_sparc.c
END
((ran >= 2 && !failed))
