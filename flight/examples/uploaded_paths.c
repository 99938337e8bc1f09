/*
 * Closest approach of two uploaded paths beside an eccentric chief.  The ground writes three blocks of doubles:
 *
 *   import closeform as cf
 *   orbit = cf.Orbit.eccentric(0.3, perigee_altitude=500e3)
 *   own = orbit.transfer([0, 200, 0, 0, 0, 0], [0, -200, 0, 0, 0, 0], 600.0)
 *   other = orbit.coast([30, 0, 0, 0, 0, 0], 600.0)
 *   open("table.bin", "wb").write(cf.flight.table_bytes(orbit))
 *   open("own.bin", "wb").write(own.arcs.tobytes())
 *   open("other.bin", "wb").write(other.arcs.tobytes())
 *
 * Usage: uploaded_paths FOLDER; `closeform flight-vectors` writes these files too.
 */
#include <stdio.h>

#include "closeform_flight.h"

#define ARC 30U /* doubles of an arc */
#define BUDGET 5000U
#define EXPECTED 0.0886871 /* ratio, by the package */

static double table_block[6U + (32U * 1843U)]; /* at most 32 windows */
static cff_arc_t own_arcs[8];
static cff_arc_t other_arcs[8];

/* Read doubles; return how many. */
static uint32_t load(const char *folder, const char *name, void *numbers, size_t size)
{
    char file[256];
    (void)snprintf(file, sizeof file, "%s/%s", folder, name);
    FILE *stream = fopen(file, "rb");
    if (stream == NULL) {
        return 0U;
    }
    const size_t count = fread(numbers, sizeof(double), size / sizeof(double), stream);
    (void)fclose(stream);
    return (uint32_t)count;
}

int main(int argc, char **argv)
{
    const char *folder = (argc > 1) ? argv[1] : ".";
    const cff_zone_t zone = {CFF_ELLIPSOID, {{1.0 / 20.0, 0.0, 0.0}, {0.0, 1.0 / 40.0, 0.0}, {0.0, 0.0, 1.0 / 20.0}}};
    cff_table_t chief;
    cff_approach_t near;
    const uint32_t count = load(folder, "table.bin", table_block, sizeof table_block);
    const cff_path_t own = {own_arcs, load(folder, "own.bin", own_arcs, sizeof own_arcs) / ARC, &chief};
    const cff_path_t other = {other_arcs, load(folder, "other.bin", other_arcs, sizeof other_arcs) / ARC, &chief};
    if (cff_uploaded_table(table_block, count, &chief) != CFF_OK || cff_check_path(&own) != CFF_OK ||
        cff_check_path(&other) != CFF_OK) {
        printf("the upload is not complete\n");
        return 1;
    }
    const cff_status_t status = cff_closest_approach(&own, &other, &zone, 0.0, 600.0, BUDGET, &near);
    printf("closest approach at %.3f s: %.6f of the zone; %u evaluations\n", near.time_s, near.ratio, (unsigned)near.evaluations_used);
    return ((status == CFF_OK) && (near.ratio > EXPECTED - 1e-6) && (near.ratio < EXPECTED + 1e-6)) ? 0 : 1;
}
