/*
 * Natural motion and transfer of minimum energy (closeform/motion/steering.py, linear.py, effort.py).
 *
 * The optimal thrust is a natural motion itself, fixed by its start and start rate.  The response to
 * those six numbers is well conditioned down to n = 0; it is solved for, and once more on the residual.
 */
#include <math.h>
#include <stddef.h>

#include "cff_internal.h"

#define SIX 6U
#define REFINEMENTS 2U
#define NODES 5U

/* Gauss-Legendre nodes and weights of degree 19 on [-1, 1]: the positive half. */
static const double NODE[NODES] = {0.1488743389816312, 0.4333953941292472, 0.6794095682990244, 0.8650633666889845,
                                   0.9739065285171717};
static const double WEIGHT[NODES] = {0.2955242247147529, 0.2692667193099964, 0.2190863625159820, 0.1494513491505806,
                                     0.0666713443086881};

/* The state reached from rest under each unit thrust (columns 0-2) and unit thrust rate (3-5). */
static void response(const cff_table_t *chief, double n, double from, double to, double matrix[SIX][SIX])
{
    cfi_transforms_t k;
    cfi_transforms(n, to - from, &k);
    for (uint32_t j = 0U; j < SIX; j++) {
        cff_state_t m = {0};
        cff_arc_t arc = {0};
        arc.start_s = from;
        arc.end_s = to;
        if (j < 3U) {
            arc.thrust_m_s2[j] = 1.0;
        } else {
            arc.thrust_rate_m_s3[j - 3U] = 1.0;
        }
        if (chief != NULL) {
            cff_state_t primer;
            cfi_arc_state(chief, &arc, to, &m, &primer);
        } else {
            cfi_add_driven(n, to - from, &k, arc.thrust_m_s2, arc.thrust_rate_m_s3, &m);
        }
        for (uint32_t i = 0U; i < 3U; i++) {
            matrix[i][j] = m.position_m[i];
            matrix[i + 3U][j] = m.velocity_m_s[i];
        }
    }
}

/* Scale columns, of very different units, and rows to a largest number of 1. */
static bool scale(double matrix[], uint32_t size, double rhs[], double columns[])
{
    bool good = true;
    for (uint32_t j = 0U; j < size; j++) {
        double largest = 0.0;
        for (uint32_t i = 0U; i < size; i++) {
            largest = cfi_max(largest, fabs(matrix[(i * size) + j]));
        }
        good = good && (largest > 0.0) && (largest <= CFF_LARGEST);
        columns[j] = good ? (1.0 / largest) : 0.0;
        for (uint32_t i = 0U; i < size; i++) {
            matrix[(i * size) + j] *= columns[j];
        }
    }
    for (uint32_t i = 0U; (i < size) && good; i++) {
        double largest = 0.0;
        for (uint32_t j = 0U; j < size; j++) {
            largest = cfi_max(largest, fabs(matrix[(i * size) + j]));
        }
        good = (largest > 0.0);
        if (good) {
            for (uint32_t j = 0U; j < size; j++) {
                matrix[(i * size) + j] /= largest;
            }
            rhs[i] /= largest;
        }
    }
    return good;
}

static void swap(double *a, double *b)
{
    const double kept = *a;
    *a = *b;
    *b = kept;
}

/* Bring the largest number of column k at or below row k to row k; false if it is 0. */
static bool pivot(double matrix[], uint32_t size, double rhs[], uint32_t k)
{
    uint32_t best = k;
    for (uint32_t i = k + 1U; i < size; i++) {
        if (fabs(matrix[(i * size) + k]) > fabs(matrix[(best * size) + k])) {
            best = i;
        }
    }
    if (best != k) {
        for (uint32_t j = k; j < size; j++) {
            swap(&matrix[(k * size) + j], &matrix[(best * size) + j]);
        }
        swap(&rhs[k], &rhs[best]);
    }
    return matrix[(k * size) + k] != 0.0;
}

/*
 * Solve equations in place by scaled, pivoted elimination; the solution is left in `rhs`.  `columns` is room for
 * as many numbers.
 */
bool cfi_solve(double matrix[], uint32_t size, double rhs[], double columns[])
{
    bool good = scale(matrix, size, rhs, columns);
    for (uint32_t k = 0U; (k < size) && good; k++) {
        good = pivot(matrix, size, rhs, k);
        for (uint32_t i = k + 1U; (i < size) && good; i++) {
            const double factor = matrix[(i * size) + k] / matrix[(k * size) + k];
            for (uint32_t j = k + 1U; j < size; j++) {
                matrix[(i * size) + j] -= factor * matrix[(k * size) + j];
            }
            rhs[i] -= factor * rhs[k];
        }
    }
    for (uint32_t left = size; (left > 0U) && good; left--) {
        const uint32_t k = left - 1U;
        for (uint32_t j = k + 1U; j < size; j++) {
            rhs[k] -= matrix[(k * size) + j] * rhs[j];
        }
        rhs[k] /= matrix[(k * size) + k];
    }
    for (uint32_t j = 0U; (j < size) && good; j++) {
        rhs[j] *= columns[j];
    }
    return good;
}

/* The start thrust and thrust rate that lead from rest at the origin to `gap`. */
bool cfi_steer(const cff_table_t *chief, double n, double from, double to, const double gap[6], double thrust[6])
{
    double matrix[SIX][SIX];
    bool good = true;
    response(chief, n, from, to, matrix);
    for (uint32_t i = 0U; i < SIX; i++) {
        thrust[i] = 0.0;
    }
    for (uint32_t turn = 0U; (turn < REFINEMENTS) && good; turn++) { /* once more on the residual of rounding */
        double work[SIX][SIX];
        double rhs[SIX];
        double columns[SIX];
        for (uint32_t i = 0U; i < SIX; i++) {
            rhs[i] = gap[i];
            for (uint32_t j = 0U; j < SIX; j++) {
                rhs[i] -= matrix[i][j] * thrust[j];
                work[i][j] = matrix[i][j];
            }
        }
        good = cfi_solve(&work[0][0], SIX, rhs, columns);
        for (uint32_t i = 0U; (i < SIX) && good; i++) {
            thrust[i] += rhs[i];
        }
    }
    return good && cfi_finite(thrust, SIX);
}

cff_status_t cff_coast(double mean_motion_rad_s, double duration_s, const cff_state_t *state, cff_state_t *later)
{
    cff_status_t status = CFF_BAD_INPUT;
    if ((mean_motion_rad_s >= 0.0) && (fabs(mean_motion_rad_s * duration_s) <= CFF_LARGEST_ANGLE_RAD) &&
        cfi_finite(&duration_s, 1U) && cfi_state_finite(state)) {
        double p[3];
        cfi_oscillation(mean_motion_rad_s, duration_s, p);
        cfi_coast(mean_motion_rad_s, duration_s, p, state->position_m, state->velocity_m_s, later);
        status = CFF_OK;
    }
    return status;
}

/* An arc of natural motion beside a table, or by Hill's equations. */
static cff_status_t drift(const cff_table_t *chief, double n, double start, double duration, const cff_state_t *initial,
                          cff_arc_t *arc)
{
    cff_arc_t made = {0};
    const cff_path_t path = {&made, 1U, chief};
    made.start_s = start;
    made.end_s = start + duration;
    made.mean_motion_rad_s = n;
    made.state = *initial;
    const cff_status_t status = (duration > 0.0) ? cff_check_path(&path) : CFF_BAD_INPUT;
    if (status == CFF_OK) {
        *arc = made;
    }
    return status;
}

static cff_status_t transfer(const cff_table_t *chief, double n, double start, double duration, const cff_state_t *initial,
                             const cff_state_t *final, cff_arc_t *arc)
{
    cff_arc_t made;
    cff_status_t status = cfi_state_finite(final) ? drift(chief, n, start, duration, initial, &made) : CFF_BAD_INPUT;
    if (status == CFF_OK) {
        const cff_path_t path = {&made, 1U, chief};
        double gap[SIX];
        double thrust[SIX];
        cff_state_t m;
        cff_state_t u;
        cfi_arc_motion(&path, 0U, made.end_s, &m, &u);
        cfi_miss(final, &m, gap);
        if (cfi_steer(chief, n, made.start_s, made.end_s, gap, thrust)) {
            for (uint32_t i = 0U; i < 3U; i++) {
                made.thrust_m_s2[i] = thrust[i];
                made.thrust_rate_m_s3[i] = thrust[i + 3U];
            }
            *arc = made;
        } else {
            status = CFF_SINGULAR;
        }
    }
    return status;
}

cff_status_t cff_drift(double mean_motion_rad_s, double start_s, double duration_s, const cff_state_t *initial,
                       cff_arc_t *arc)
{
    return drift(NULL, mean_motion_rad_s, start_s, duration_s, initial, arc);
}

cff_status_t cff_drift_beside(const cff_table_t *chief, double start_s, double duration_s, const cff_state_t *initial,
                              cff_arc_t *arc)
{
    return drift(chief, 0.0, start_s, duration_s, initial, arc);
}

cff_status_t cff_transfer(double mean_motion_rad_s, double start_s, double duration_s, const cff_state_t *initial,
                          const cff_state_t *final, cff_arc_t *arc)
{
    return transfer(NULL, mean_motion_rad_s, start_s, duration_s, initial, final, arc);
}

cff_status_t cff_transfer_beside(const cff_table_t *chief, double start_s, double duration_s, const cff_state_t *initial,
                                 const cff_state_t *final, cff_arc_t *arc)
{
    return transfer(chief, 0.0, start_s, duration_s, initial, final, arc);
}

/* The energy of an arc: its optimal thrust is a natural motion, of which views are integrated by Gauss's rule. */
static double energy_of(const cff_path_t *path, uint32_t k)
{
    cff_arc_t primer = {0};
    const cff_path_t coast = {&primer, 1U, path->chief};
    cff_cursor_t place;
    double total = 0.0;
    double t = path->arcs[k].start_s;
    primer.start_s = path->arcs[k].start_s;
    primer.end_s = path->arcs[k].end_s;
    primer.mean_motion_rad_s = path->arcs[k].mean_motion_rad_s;
    for (uint32_t i = 0U; i < 3U; i++) {
        primer.state.position_m[i] = path->arcs[k].thrust_m_s2[i];
        primer.state.velocity_m_s[i] = path->arcs[k].thrust_rate_m_s3[i];
    }
    cfi_begin_place(&coast, &place, primer.start_s);
    bool on = (t < primer.end_s);
    while (on) { /* at most CFF_MOST_WINDOWS turns, or CFF_LARGEST_ANGLE_RAD over that of a view */
        cfi_view_t view;
        cfi_see_coast(&coast, &place, t, primer.end_s, &view);
        for (uint32_t m = 0U; m < (2U * NODES); m++) {
            const double u = 0.5 + (((m % 2U) == 0U) ? (0.5 * NODE[m / 2U]) : (-0.5 * NODE[m / 2U]));
            const double weight = 0.5 * WEIGHT[m / 2U] * cfi_pace(&view, u);
            for (uint32_t i = 0U; i < 3U; i++) {
                double slope;
                const double thrust = cfi_value(view.c[i], u, &slope);
                total += weight * thrust * thrust;
            }
        }
        on = (view.until_s > t) && (view.until_s < primer.end_s);
        t = view.until_s;
    }
    return 0.5 * total;
}

cff_status_t cff_energy(const cff_path_t *path, double *energy_m2_s3)
{
    cff_status_t status = cff_check_path(path);
    double total = 0.0;
    for (uint32_t k = 0U; (k < path->count) && (status == CFF_OK); k++) {
        if (cfi_pushes(&path->arcs[k])) {
            status = CFF_BAD_INPUT;
        } else {
            total += energy_of(path, k);
        }
    }
    if ((status == CFF_OK) && (fabs(total) <= CFF_FOREVER)) {
        *energy_m2_s3 = total;
    } else {
        status = CFF_BAD_INPUT;
    }
    return status;
}
