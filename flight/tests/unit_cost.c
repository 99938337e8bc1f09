/* What single pieces of work cost: -DWORK=k, -DREPEAT=n; counted by tools/unit_cost.sh. */
#include "../src/cff_internal.h"
#ifndef REPEAT
#define REPEAT 1
#endif
#ifndef WORK
#define WORK 0
#endif

static const cff_arc_t arcs[2] = {
    {0.0, 5000.0, 1.1e-3, {0, 0, 0}, {{10.0, 200.0, 30.0}, {0.01, 0.1, 0.05}}, {1e-5, 2e-5, 3e-5}, {1e-8, 1e-8, 1e-8}, {1e-5, 1e-5, 1e-5}, {1e-9, 1e-9, 1e-9}, {1e-12, 1e-12, 1e-12}, {1e-15, 1e-15, 1e-15}},
    {0.0, 5000.0, 1.1e-3, {0, 0, 0}, {{-10.0, 0.0, 30.0}, {0.02, -0.1, 0.05}}, {1e-5, -2e-5, 3e-5}, {-1e-8, 1e-8, 1e-8}, {1e-5, 1e-5, 1e-5}, {1e-9, 1e-9, 1e-9}, {1e-12, 1e-12, 1e-12}, {1e-15, 1e-15, 1e-15}}};

volatile double sink;
volatile double when = 700.0;

int main(void)
{
    const cff_zone_t ball = {CFF_ELLIPSOID, {{0.05, 0.01, 0.0}, {0.0, 0.05, 0.0}, {0.01, 0.0, 0.05}}};
    cfi_view_t view;
    cfi_bounds_t bounds;
    cfi_motion_t m;
    cfi_see(&arcs[0], &arcs[1], when, &ball, &view);
    cfi_bounds(&view, 900.0, &bounds);
    cfi_evaluate(&view, when, &m);
    for (int k = 0; k < REPEAT; k++) {
        if (WORK == 1) { /* a step outside an ellipsoid, both thrust */
            cfi_evaluate(&view, when, &m);
            sink = cfi_norm(CFF_ELLIPSOID, m.r);
            sink = cfi_outside_step(CFF_ELLIPSOID, &m, &bounds, 0.1);
        }
        if (WORK == 2) { /* a step inside a box, both thrust */
            cfi_evaluate(&view, when, &m);
            sink = cfi_norm(CFF_BOX, m.r);
            sink = cfi_inside_step(CFF_BOX, &m, &bounds, 1e3);
        }
        if (WORK == 3) { /* a view of two arcs with both kinds of thrust, beyond n t = 2, and its bounds */
            cfi_see(&arcs[0], &arcs[1], when * 4.0, &ball, &view);
            cfi_bounds(&view, when, &bounds);
        }
        if (WORK == 4) { /* the same within n t = 2 */
            cfi_see(&arcs[0], &arcs[1], when, &ball, &view);
            cfi_bounds(&view, when, &bounds);
        }
        if (WORK == 5) { /* a Taylor model that never succeeds */
            sink = cfi_taylor_step(&view, when, 1e9, false);
        }
        if (WORK == 6) { /* the check of an arc that joins another */
            const cff_path_t path = {arcs, 2U};
            sink = (double)cff_check_path(&path);
        }
        if (WORK == 7) { /* the exclusion of two natural motions */
            view.order = CFF_COAST_ORDER;
            sink = (double)cfi_coasts_apart(&view, CFF_BOX, when);
        }
    }
    return 0;
}
