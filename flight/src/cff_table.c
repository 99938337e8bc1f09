/*
 * Motion beside the chief of a table (closeform/motion/chief/segments.py, clock.py; theory 97).
 *
 * The columns of a motion are its state (r, v/n), its costate (p/n^2, p'/n^3) and its constant push a/n^2
 * where a window begins.  In the window position and velocity are polynomials, linear in the columns; the
 * costate moves as the state of natural motion does, and the optimal thrust is p.
 */
#include <math.h>
#include <stddef.h>

#include "cff_internal.h"

#define COSTATE 6U
#define PUSH 12U
#define HEAD 5U /* numbers of an uploaded table before its arrays */
#define ROWS (CFF_COLUMNS * 6U * CFF_TERMS) /* numbers of a window in the arrays */
#define STEPS (6U * CFF_COLUMNS)
#define RETURNS (9U * 6U * CFF_TERMS)
#define TURN 6.283185307179586
#define NEWTON_STEPS 30U
#define FARTHEST_RAD 1.0e5 /* of joints and angles: beyond, the phase loses digits */

/* The angle of a time, by Newton's method on Kepler's equation. */
double cfi_angle(const cff_table_t *chief, double t)
{
    const double e = chief->eccentricity;
    double mean = (chief->rate_rad_s * t) + chief->phase_rad;
    double angle = mean;
    if (e != 0.0) {
        const double turns = TURN * cfi_whole((mean / TURN) + 0.5);
        bool on = true;
        mean -= turns;
        angle = mean + ((mean > 0.0) ? (0.85 * e) : (-0.85 * e));
        for (uint32_t k = 0U; (k < NEWTON_STEPS) && on; k++) {
            double sine;
            double cosine;
            cfi_sine_cosine(angle, &sine, &cosine);
            const double step = (angle - (e * sine) - mean) / (1.0 - (e * cosine));
            angle -= step;
            on = (fabs(step) > (1e-16 + (2.3e-16 * fabs(angle))));
        }
        angle += turns;
    }
    return angle;
}

/* The time of an angle. */
double cfi_time(const cff_table_t *chief, double angle)
{
    double sine = 0.0;
    double cosine;
    if (chief->eccentricity != 0.0) {
        cfi_sine_cosine(angle, &sine, &cosine);
    }
    return (angle - (chief->eccentricity * sine) - chief->phase_rad) / chief->rate_rad_s;
}

/* How many turns of the table lie before an angle. */
static double turns_before(const cff_table_t *chief, double angle)
{
    return (chief->turn_rad > 0.0) ? cfi_whole(((angle + CFF_ON_JOINT) - chief->joints_rad[0]) / chief->turn_rad) : 0.0;
}

/* Whether the table holds motion between two times, and an arc between them is not too long. */
bool cfi_within_table(const cff_table_t *chief, double from, double to)
{
    const double largest = 0.5 * FARTHEST_RAD / chief->rate_rad_s;
    bool good = (fabs(from) <= largest) && (fabs(to) <= largest) && (from <= to);
    if (good) {
        const double first = cfi_angle(chief, from);
        const double last = cfi_angle(chief, to);
        if (chief->turn_rad > 0.0) {
            const double turns = ((last - first) / chief->turn_rad) + 2.0;
            good = ((turns * (double)chief->windows) <= (double)CFF_MOST_WINDOWS);
        } else {
            const double slack = 1e-12 * (fabs(first) + fabs(last) + 1.0);
            good = (first >= (chief->joints_rad[0] - slack)) && (last <= (chief->joints_rad[chief->windows] + slack));
        }
    }
    return good;
}

/* Whether the numbers of the clock are in their ranges. */
bool cfi_clock_is_good(const cff_table_t *chief)
{
    return cfi_finite(&chief->rate_rad_s, 1U) && (chief->rate_rad_s > 0.0) && (chief->eccentricity >= 0.0) &&
           (chief->eccentricity < 1.0) && (fabs(chief->phase_rad) <= FARTHEST_RAD) && (chief->turn_rad >= 0.0) &&
           (chief->turn_rad <= FARTHEST_RAD) && (chief->windows > 0U) && (chief->windows <= CFF_MOST_WINDOWS);
}

cff_status_t cff_check_table(const cff_table_t *chief)
{
    bool good = cfi_clock_is_good(chief);
    for (uint32_t k = 0U; good && (k <= chief->windows); k++) {
        good = (fabs(chief->joints_rad[k]) <= FARTHEST_RAD) &&
               ((k == 0U) || (chief->joints_rad[k] > (chief->joints_rad[k - 1U] + CFF_ON_JOINT)));
    }
    if (good && (chief->turn_rad > 0.0)) {
        const double way = chief->joints_rad[chief->windows] - chief->joints_rad[0];
        good = (fabs(way - chief->turn_rad) <= (1e-12 * chief->turn_rad));
    }
    for (uint32_t k = 0U; good && (k < chief->windows); k++) {
        good = cfi_finite(&chief->rows[(size_t)k * ROWS], ROWS) && cfi_finite(&chief->steps[(size_t)k * STEPS], STEPS) &&
               cfi_finite(&chief->errors[(size_t)k * CFF_COLUMNS], CFF_COLUMNS);
        if (good && (chief->returns != NULL) && (chief->return_errors != NULL)) {
            good = cfi_finite(&chief->returns[(size_t)k * RETURNS], RETURNS) &&
                   cfi_finite(&chief->return_errors[(size_t)k * 9U], 9U);
        }
    }
    return good ? CFF_OK : CFF_BAD_INPUT;
}

cff_status_t cff_uploaded_table(const double block[], uint32_t count, cff_table_t *table)
{
    cff_status_t status = CFF_BAD_INPUT;
    const double number = (count > HEAD) ? block[HEAD - 1U] : 0.0;
    if ((number >= 1.0) && (number <= (double)CFF_MOST_WINDOWS)) {
        const uint32_t windows = (uint32_t)number;
        const uint32_t size = 1U + ROWS + STEPS + CFF_COLUMNS + RETURNS + 9U; /* of a window */
        if (((double)windows == number) && (count == (HEAD + 1U + (windows * size)))) {
            const double *joints = &block[HEAD];
            const double *rows = &joints[windows + 1U];
            const double *steps = &rows[windows * ROWS];
            const double *errors = &steps[windows * STEPS];
            const double *returns = &errors[windows * CFF_COLUMNS];
            const cff_table_t made = {block[0], block[1], block[2], block[3], windows, joints, rows, steps, errors, returns,
                                      &returns[windows * RETURNS]};
            status = cff_check_table(&made);
            if (status == CFF_OK) {
                *table = made;
            }
        }
    }
    return status;
}

/* The coefficients of component i of column j in window k. */
const double *cfi_row(const cff_table_t *chief, uint32_t k, uint32_t j, uint32_t i)
{
    return &chief->rows[((((size_t)k * CFF_COLUMNS) + j) * 72U) + ((size_t)i * CFF_TERMS)];
}

/* The angle of joint k after so many turns: one number for the end of a turn and the beginning of the next. */
static double joint(const cff_table_t *chief, uint32_t k, double turns)
{
    const bool wraps = (chief->turn_rad > 0.0) && (k == chief->windows);
    return wraps ? ((chief->turn_rad * (turns + 1.0)) + chief->joints_rad[0])
                 : ((chief->turn_rad * turns) + chief->joints_rad[k]);
}

/* How many turns of the table lie before a place. */
static double turns_at(const cff_table_t *chief, const cff_cursor_t *place)
{
    const double way = place->origin_rad - chief->joints_rad[place->window];
    return (chief->turn_rad > 0.0) ? cfi_whole((way / chief->turn_rad) + 0.5) : 0.0;
}

double cfi_window_end(const cff_table_t *chief, const cff_cursor_t *place)
{
    return joint(chief, place->window + 1U, turns_at(chief, place));
}

/* The place of an angle in a window, in [0, 1]. */
double cfi_share(const cff_table_t *chief, const cff_cursor_t *place, double angle)
{
    const double length = chief->joints_rad[place->window + 1U] - chief->joints_rad[place->window];
    return cfi_min(cfi_max((angle - place->origin_rad) / length, 0.0), 1.0);
}

/* Component i of column j at the point of the window with these weights. */
static double at(const cff_table_t *chief, uint32_t k, uint32_t j, uint32_t i, const double weights[CFF_TERMS])
{
    const double *f = cfi_row(chief, k, j, i);
    double total = 0.0;
    for (uint32_t b = 0U; b < CFF_TERMS; b++) {
        total += weights[b] * f[b];
    }
    return total;
}

/* State and costate at u of the window. */
static void columns_in(const cff_table_t *chief, const cff_cursor_t *place, double u, double out[CFF_COLUMNS])
{
    const double *z = place->columns;
    double weights[CFF_TERMS];
    cfi_weights(u, weights);
    for (uint32_t i = 0U; i < CFF_COLUMNS; i++) {
        out[i] = (i < PUSH) ? 0.0 : z[i];
    }
    for (uint32_t j = 0U; j < CFF_COLUMNS; j++) {
        for (uint32_t i = 0U; (i < 6U) && (z[j] != 0.0); i++) {
            out[i] += z[j] * at(chief, place->window, j, i, weights);
        }
    }
    for (uint32_t j = 0U; j < 6U; j++) {
        for (uint32_t i = 0U; (i < 6U) && (z[COSTATE + j] != 0.0); i++) {
            out[COSTATE + i] += z[COSTATE + j] * at(chief, place->window, j, i, weights);
        }
    }
}

void cfi_columns_at(const cff_table_t *chief, const cff_cursor_t *place, double t, double columns[CFF_COLUMNS])
{
    columns_in(chief, place, cfi_share(chief, place, cfi_angle(chief, t)), columns);
}

/* The transition matrix from the beginning of the window. */
static void flow(const cff_table_t *chief, uint32_t window, const double weights[CFF_TERMS], double matrix[6][6])
{
    for (uint32_t j = 0U; j < 6U; j++) {
        for (uint32_t i = 0U; i < 6U; i++) {
            matrix[i][j] = at(chief, window, j, i, weights);
        }
    }
}

/* Replace the columns at u by those at the beginning of the window: transition matrices are not singular. */
void cfi_go_back(const cff_table_t *chief, cff_cursor_t *place, double u)
{
    double weights[CFF_TERMS];
    double matrix[6][6];
    double columns[6];
    double *z = place->columns;
    cfi_weights(u, weights);
    flow(chief, place->window, weights, matrix);
    bool driven = false;
    for (uint32_t j = COSTATE; j < PUSH; j++) {
        driven = driven || (z[j] != 0.0);
    }
    if (driven) {
        (void)cfi_solve(&matrix[0][0], 6U, &z[COSTATE], columns);
        flow(chief, place->window, weights, matrix);
    }
    for (uint32_t j = COSTATE; j < CFF_COLUMNS; j++) {
        for (uint32_t i = 0U; (i < 6U) && (z[j] != 0.0); i++) {
            z[i] -= z[j] * at(chief, place->window, j, i, weights);
        }
    }
    (void)cfi_solve(&matrix[0][0], 6U, z, columns);
}

/* Go on to the next window. */
void cfi_next_window(const cff_table_t *chief, cff_cursor_t *place)
{
    const double *step = &chief->steps[(size_t)place->window * 6U * CFF_COLUMNS];
    double z[PUSH];
    for (uint32_t i = 0U; i < 6U; i++) {
        z[i] = 0.0;
        z[COSTATE + i] = 0.0;
        for (uint32_t j = 0U; j < CFF_COLUMNS; j++) {
            z[i] += step[(i * CFF_COLUMNS) + j] * place->columns[j];
        }
        for (uint32_t j = 0U; j < 6U; j++) {
            z[COSTATE + i] += step[(i * CFF_COLUMNS) + j] * place->columns[COSTATE + j];
        }
    }
    for (uint32_t i = 0U; i < PUSH; i++) {
        place->columns[i] = z[i];
    }
    place->origin_rad = cfi_window_end(chief, place);
    place->window = ((place->window + 1U) < chief->windows) ? (place->window + 1U) : 0U;
}

/* Whether a window lies after that of a place. */
static bool window_after(const cff_table_t *chief, const cff_cursor_t *place)
{
    return (chief->turn_rad > 0.0) || ((place->window + 1U) < chief->windows);
}

/* Move a place on to the window that holds time t. */
void cfi_go_on(const cff_table_t *chief, cff_cursor_t *place, double t)
{
    const double angle = cfi_angle(chief, t) + CFF_ON_JOINT;
    bool on = (cfi_window_end(chief, place) <= angle) && window_after(chief, place);
    for (uint32_t k = 0U; (k < CFF_MOST_WINDOWS) && on; k++) {
        cfi_next_window(chief, place);
        on = (cfi_window_end(chief, place) <= angle) && window_after(chief, place);
    }
}

/* Set a place to where an arc is at time t. */
void cfi_place(const cff_table_t *chief, const cff_arc_t *arc, double t, cff_cursor_t *place)
{
    const double n = chief->rate_rad_s;
    const double begin = cfi_angle(chief, arc->start_s);
    const double turns = turns_before(chief, begin);
    uint32_t first = 0U;
    for (uint32_t step = CFF_MOST_WINDOWS / 2U; step > 0U; step /= 2U) { /* by halves */
        if (((first + step) < chief->windows) && (joint(chief, first + step, turns) <= (begin + CFF_ON_JOINT))) {
            first += step;
        }
    }
    place->window = first;
    place->origin_rad = joint(chief, first, turns);
    for (uint32_t i = 0U; i < 3U; i++) {
        place->columns[i] = arc->state.position_m[i];
        place->columns[3U + i] = arc->state.velocity_m_s[i] / n;
        place->columns[COSTATE + i] = arc->thrust_m_s2[i] / (n * n);
        place->columns[COSTATE + 3U + i] = arc->thrust_rate_m_s3[i] / (n * n * n);
        place->columns[PUSH + i] = arc->push_m_s2[i] / (n * n);
    }
    const double u = cfi_share(chief, place, begin);
    if (u > 0.0) {
        cfi_go_back(chief, place, u);
    }
    cfi_go_on(chief, place, t);
}

/* State and thrust at time t of an arc beside the chief. */
void cfi_arc_state(const cff_table_t *chief, const cff_arc_t *arc, double t, cff_state_t *state, cff_state_t *primer)
{
    const double n = chief->rate_rad_s;
    cff_cursor_t place;
    double z[CFF_COLUMNS];
    cfi_place(chief, arc, t, &place);
    cfi_columns_at(chief, &place, t, z);
    for (uint32_t i = 0U; i < 3U; i++) {
        state->position_m[i] = z[i];
        state->velocity_m_s[i] = n * z[3U + i];
        primer->position_m[i] = n * n * z[COSTATE + i];
        primer->velocity_m_s[i] = n * n * n * z[COSTATE + 3U + i];
    }
}

/* Fill in the polynomials of a window, in zone units, of motion with these columns, and bounds of their errors. */
void cfi_see_window(const cff_table_t *chief, uint32_t window, const double columns[CFF_COLUMNS], const cff_zone_t *zone,
                    cfi_view_t *view)
{
    double off = 0.0;
    for (uint32_t i = 0U; i < 3U; i++) {
        for (uint32_t b = 0U; b < CFF_TERMS; b++) {
            view->c[i][b] = 0.0;
        }
    }
    for (uint32_t j = 0U; j < CFF_COLUMNS; j++) {
        for (uint32_t i = 0U; (i < 3U) && (columns[j] != 0.0); i++) {
            const double *f = cfi_row(chief, window, j, i);
            for (uint32_t b = 0U; b < CFF_TERMS; b++) {
                view->c[i][b] += columns[j] * f[b];
            }
        }
        off += fabs(columns[j]) * chief->errors[((size_t)window * CFF_COLUMNS) + j];
    }
    for (uint32_t b = 0U; b < CFF_TERMS; b++) {
        const double r[3] = {view->c[0][b], view->c[1][b], view->c[2][b]};
        for (uint32_t i = 0U; i < 3U; i++) {
            view->c[i][b] = cfi_dot(zone->to_unit_per_m[i], r);
        }
    }
    for (uint32_t i = 0U; i < 3U; i++) {
        const double *m = zone->to_unit_per_m[i];
        view->off[i] = off * ((fabs(m[0]) + fabs(m[1])) + fabs(m[2]));
    }
}
