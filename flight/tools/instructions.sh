#!/bin/bash
# Guest instructions of each kind of work of the golden vectors, per target: the difference of 5 and 1 repeats, over 4.
cd "$(dirname "$0")/.."
count() { timeout 300 $1 -plugin build/libcount.so -d plugin build/golden_count 2>&1 >/dev/null | grep -o 'instructions [0-9]*' | cut -d' ' -f2; }
F="-std=gnu99 -fno-math-errno -ffp-contract=off -DCFF_FREESTANDING"
while IFS='|' read -r label compiler run libs; do
    for o in -O2 -Os; do
        line="$label $o:"
        for work in "1 conflicts 149" "2 closest 149" "3 transfer 50" "4 lock 100" "5 avoid 19"; do
            set -- $work
            for r in 1 5; do
                $compiler $F $o -DWORK=$1 -DREPEAT=$r src/*.c tests/golden.c $libs -o build/golden_count || exit 1
                eval n$r=$(count "$run")
            done
            line="$line $2 $(( (n5 - n1) / 4 / $3 ))"
        done
        echo "$line instructions each"
    done
done <<'T'
x86-64|gcc|qemu-x86_64|-static -lm
Cortex-A9 (ARMv7, double FPU)|arm-linux-gnueabihf-gcc -mcpu=cortex-a9 -mfpu=vfpv3-d16|qemu-arm|-static -lm
Cortex-M7 (Thumb-2, double FPU)|arm-none-eabi-gcc -mcpu=cortex-m7 -mthumb -mfloat-abi=hard -mfpu=fpv5-d16|qemu-arm -cpu max|-nostartfiles tests/start_thumb.c -lm --specs=nosys.specs
Cortex-M4 (Thumb-2, software double)|arm-none-eabi-gcc -mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16|qemu-arm -cpu max|-nostartfiles tests/start_thumb.c -lm --specs=nosys.specs
LEON3 (SPARC v8, FPU)|sparc64-linux-gnu-gcc -m32 -mcpu=leon3 -fno-tree-loop-distribute-patterns -fno-pie -no-pie|qemu-sparc -cpu LEON3|-nostdlib -static tests/start_sparc.c -lgcc
RV64GC|riscv64-linux-gnu-gcc|qemu-riscv64|-static -lm
AArch64|aarch64-linux-gnu-gcc|qemu-aarch64|-static -lm
T
