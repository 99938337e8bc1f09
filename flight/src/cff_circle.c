/*
 * The table of a circular orbit or of deep space (theory 97), from power series of Hill's equations.
 *
 * All windows are alike, so one that repeats is enough.  Its angle runs from 0 to 1; time is counted in windows.
 */
#include <math.h>

#include "cff_internal.h"

#define COSTATE 6U
#define PUSH 12U
#define LONGEST 0.7853981633974483 /* rad of the orbit in a window: the series of views serve as far */
#define ROUNDING 4.0e-15           /* of a coefficient, relative to the largest */

/* The polynomial of a series; a bound of its error is added to `off`. */
static void fit(const double powers[CFF_POWERS], double f[CFF_TERMS], double *off)
{
    double largest = 0.0;
    cfi_from_powers(powers, f, off);
    for (uint32_t b = 0U; b < CFF_TERMS; b++) {
        largest = cfi_max(largest, fabs(f[b]));
    }
    *off += ROUNDING * largest;
}

/* The coefficient of power k of component i of (r, v), from the series of r. */
static double component(double r[3][CFF_POWERS], uint32_t i, uint32_t k)
{
    double value = 0.0;
    if (i < 3U) {
        value = r[i][k];
    } else if ((k + 1U) < CFF_POWERS) {
        value = ((double)k + 1.0) * r[i - 3U][k + 1U];
    } else {
        /* beyond the series */
    }
    return value;
}

/* The series of natural motion from unit state j on. */
static void natural(double angle, uint32_t j, double r[3][CFF_POWERS])
{
    cfi_start_t start = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}, {{0.0, 0.0, 0.0}}};
    if (j < 3U) {
        start.r[j] = 1.0;
    } else {
        start.v[j - 3U] = 1.0;
    }
    cfi_series(angle, &start, r);
}

/* The response to column j: its polynomials and their end. */
static void respond(double angle, uint32_t j, cff_circle_t *room)
{
    cfi_start_t start = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}, {{0.0, 0.0, 0.0}}};
    double *const units[5] = {start.r, start.v, start.u, start.w, start.push[0]};
    double r[3][CFF_POWERS];
    units[j / 3U][j % 3U] = 1.0;
    cfi_series(angle, &start, r);
    room->errors[j] = 0.0;
    for (uint32_t i = 0U; i < 6U; i++) {
        double powers[CFF_POWERS];
        double *f = &room->rows[(j * 72U) + (i * CFF_TERMS)];
        double off = 0.0;
        for (uint32_t k = 0U; k < CFF_POWERS; k++) {
            powers[k] = component(r, i, k);
        }
        fit(powers, f, &off);
        room->errors[j] = (i < 3U) ? cfi_max(room->errors[j], off) : room->errors[j];
        room->steps[(i * CFF_COLUMNS) + j] = f[CFF_TERMS - 1U];
    }
}

/* The change of component i of the first state by column j of costate and push: integral of Phi(-s) B thrust(s). */
static void give_back(double angle, uint32_t j, uint32_t i, cff_circle_t *room)
{
    double sum[CFF_POWERS] = {0};
    double thrust[3][CFF_POWERS] = {{0}};
    if (j < PUSH) {
        natural(angle, j - COSTATE, thrust);
    } else {
        thrust[j - PUSH][0] = 1.0;
    }
    for (uint32_t axis = 0U; axis < 3U; axis++) {
        double r[3][CFF_POWERS];
        natural(angle, 3U + axis, r);
        for (uint32_t m = 0U; m < CFF_POWERS; m++) {
            const double back = ((m % 2U) == 0U) ? component(r, i, m) : -component(r, i, m);
            for (uint32_t k = 0U; (k + m + 1U) < CFF_POWERS; k++) {
                sum[k + m + 1U] += back * thrust[axis][k] / ((double)k + (double)m + 1.0);
            }
        }
    }
    fit(sum, &room->returns[((j - COSTATE) * 72U) + (i * CFF_TERMS)], &room->return_errors[j - COSTATE]);
}

cff_status_t cff_circular_table(double mean_motion_rad_s, double window_s, cff_circle_t *room, cff_table_t *table)
{
    const double angle = mean_motion_rad_s * window_s;
    cff_status_t status = CFF_BAD_INPUT;
    if ((mean_motion_rad_s >= 0.0) && (window_s >= CFF_SHORTEST_S) && (window_s <= CFF_LARGEST) && (angle <= LONGEST)) {
        const cff_table_t made = {1.0 / window_s, 0.0, 0.0, 1.0, 1U, room->joints_rad, room->rows, room->steps,
                                  room->errors, room->returns, room->return_errors};
        room->joints_rad[0] = 0.0;
        room->joints_rad[1] = 1.0;
        for (uint32_t j = 0U; j < CFF_COLUMNS; j++) {
            respond(angle, j, room);
        }
        for (uint32_t j = COSTATE; j < CFF_COLUMNS; j++) {
            room->return_errors[j - COSTATE] = 0.0;
            for (uint32_t i = 0U; i < 6U; i++) {
                give_back(angle, j, i, room);
            }
        }
        *table = made;
        status = CFF_OK;
    }
    return status;
}
