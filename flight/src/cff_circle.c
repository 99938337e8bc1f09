/*
 * The table of a circular orbit or of deep space (theory 97), from power series of Hill's equations.
 *
 * All windows are alike, so one that repeats is enough.  Its angle runs from 0 to 1; time is counted in windows.
 */
#include <math.h>

#include "cff_internal.h"

#define COSTATE 6U
#define PUSH 12U

/* The coefficients of a power of (r, v): of the next power of r for v. */
static void coefficients(const cfi_start_t *s, uint32_t k, double out[6])
{
    for (uint32_t i = 0U; i < 3U; i++) {
        out[i] = s->r[i];
        out[i + 3U] = ((double)k + 1.0) * s->v[i];
    }
}

/* Begin the motion with column j at 1. */
static void begin_unit(uint32_t j, cfi_start_t *s)
{
    for (uint32_t i = 0U; i < 3U; i++) {
        s->r[i] = (j == i) ? 1.0 : 0.0;
        s->v[i] = (j == (3U + i)) ? 1.0 : 0.0;
        s->u[i] = (j == (COSTATE + i)) ? 1.0 : 0.0;
        s->w[i] = (j == (COSTATE + 3U + i)) ? 1.0 : 0.0;
        s->push[0][i] = (j == (PUSH + i)) ? 1.0 : 0.0;
        s->push[1][i] = 0.0;
        s->push[2][i] = 0.0;
        s->push[3][i] = 0.0;
    }
}

static void begin_all(double f[72])
{
    for (uint32_t k = 0U; k < 72U; k++) {
        f[k] = 0.0;
    }
}

/* End six polynomials; returns the largest error of the first `count`, with rounding. */
static double end_all(double f[], double off[6], uint32_t count)
{
    double error = 0.0;
    for (uint32_t i = 0U; i < 6U; i++) {
        double least;
        double most;
        cfi_end_powers(&f[i * CFF_TERMS]);
        cfi_hull(&f[i * CFF_TERMS], &least, &most);
        off[i] += CFF_ROUNDING * cfi_max(-least, most);
        error = (i < count) ? cfi_max(error, off[i]) : error;
    }
    return error;
}

/* The response to column j: its polynomials and their end. */
static void respond(double angle, uint32_t j, cff_circle_t *room)
{
    double *f = &room->rows[j * 72U];
    double off[6] = {0};
    cfi_start_t s;
    begin_unit(j, &s);
    begin_all(f);
    for (uint32_t k = 0U; k < CFF_POWERS; k++) {
        double c[6];
        coefficients(&s, k, c);
        for (uint32_t i = 0U; i < 6U; i++) {
            cfi_add_power(k, c[i], &f[i * CFF_TERMS], &off[i]);
        }
        cfi_step(angle, k, &s);
    }
    room->errors[j] = end_all(f, off, 3U);
    for (uint32_t i = 0U; i < 6U; i++) {
        room->steps[(i * CFF_COLUMNS) + j] = f[(i * CFF_TERMS) + CFF_TERMS - 1U];
    }
}

/* The change of the first state by column j of costate and push: the integral of Phi(-s) B thrust(s). */
static void give_back(double angle, uint32_t j, cff_circle_t *room)
{
    double *f = &room->returns[(j - COSTATE) * 72U];
    double off[6] = {0};
    begin_all(f);
    for (uint32_t axis = 0U; axis < 3U; axis++) {
        cfi_start_t back;
        begin_unit(3U + axis, &back);
        for (uint32_t m = 0U; (m + 1U) < CFF_POWERS; m++) {
            const double sign = ((m % 2U) == 0U) ? 1.0 : -1.0;
            double c[6];
            cfi_start_t thrust;
            begin_unit((j < PUSH) ? (j - COSTATE) : j, &thrust);
            coefficients(&back, m, c);
            for (uint32_t k = 0U; (k + m + 1U) < CFF_POWERS; k++) {
                const double force = (j < PUSH) ? thrust.r[axis] : thrust.push[0][axis];
                for (uint32_t i = 0U; i < 6U; i++) {
                    cfi_add_power(k + m + 1U, sign * c[i] * force / ((double)k + (double)m + 1.0), &f[i * CFF_TERMS], &off[i]);
                }
                cfi_step(angle, k, &thrust);
            }
            cfi_step(angle, m, &back);
        }
    }
    room->return_errors[j - COSTATE] = end_all(f, off, 6U);
}

cff_status_t cff_circular_table(double mean_motion_rad_s, double window_s, cff_circle_t *room, cff_table_t *table)
{
    const double angle = mean_motion_rad_s * window_s;
    cff_status_t status = CFF_BAD_INPUT;
    if ((mean_motion_rad_s >= 0.0) && (window_s >= CFF_SHORTEST_S) && (window_s <= CFF_LARGEST) && (angle <= CFF_REACH)) {
        const cff_table_t made = {1.0 / window_s, 0.0, 0.0, 1.0, 1U, room->joints_rad, room->rows, room->steps,
                                  room->errors, room->returns, room->return_errors};
        room->joints_rad[0] = 0.0;
        room->joints_rad[1] = 1.0;
        for (uint32_t j = 0U; j < CFF_COLUMNS; j++) {
            respond(angle, j, room);
        }
        for (uint32_t j = COSTATE; j < CFF_COLUMNS; j++) {
            give_back(angle, j, room);
        }
        *table = made;
        status = CFF_OK;
    }
    return status;
}
