#!/bin/bash
cd "$(dirname "$0")/.."
count() { timeout 300 $1 -plugin build/libcount.so -d plugin build/golden_count 2>&1 >/dev/null | grep -o 'instructions [0-9]*' | cut -d' ' -f2; }
F="-std=gnu99 -fno-math-errno -ffp-contract=off"
while IFS='|' read -r label compiler run libs; do
    line="$label:"
    for work in "1 step-ball" "2 step-box-inside" "3 view-far" "4 view-near" "5 taylor-worst" "6 check-2-arcs" "7 exclusion"; do
        set -- $work
        for r in 10 110; do
            $compiler $F -O2 -DWORK=$1 -DREPEAT=$r src/*.c tests/unit_cost.c $libs -o build/golden_count || exit 1
            eval n$r=$(count "$run")
        done
        line="$line $2 $(( (n110 - n10) / 100 ))"
    done
    echo "$line"
done <<'T'
Cortex-M7|arm-none-eabi-gcc -mcpu=cortex-m7 -mthumb -mfloat-abi=hard -mfpu=fpv5-d16|qemu-arm -cpu max|-nostartfiles tests/start_thumb.c -lm --specs=nosys.specs
Cortex-M4 software double|arm-none-eabi-gcc -mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16|qemu-arm -cpu max|-nostartfiles tests/start_thumb.c -lm --specs=nosys.specs
LEON3|sparc64-linux-gnu-gcc -m32 -mcpu=leon3 -fno-tree-loop-distribute-patterns -fno-pie -no-pie|qemu-sparc -cpu LEON3|-nostdlib -static tests/start_sparc.c -lgcc
T
