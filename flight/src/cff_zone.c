/*
 * Zones as sets of parts (closeform/zones/shapes.py, conflicts/chief/sign_changes.py).
 *
 * A part is round, |q|^2 <= 1 over three axes or two, or flat, +-q_i <= 1.  A spacecraft is inside while
 * every part holds.  The level of a part is 1 plus the error of the polynomials, so that no motion is inside
 * unseen.
 */
#include <math.h>

#include "cff_internal.h"

/* The axes over which a part is round; 0 for a flat part. */
uint32_t cfi_round_axes(cff_shape_t shape, uint32_t part)
{
    uint32_t axes = 0U;
    if (shape == CFF_ELLIPSOID) {
        axes = 3U;
    } else if ((shape == CFF_CYLINDER) && (part == 0U)) {
        axes = 2U;
    } else {
        /* flat */
    }
    return axes;
}

/* The axis of a flat part, and the sign of its side. */
static uint32_t flat_axis(cff_shape_t shape, uint32_t part, double *sign)
{
    const uint32_t side = (shape == CFF_CYLINDER) ? (part + 3U) : part; /* 4 and 5 for the ends of a cylinder */
    *sign = ((side % 2U) == 0U) ? 1.0 : -1.0;
    return (side < 5U) ? (side / 2U) : 2U;
}

uint32_t cfi_part_count(cff_shape_t shape)
{
    uint32_t count = 1U;
    if (shape == CFF_BOX) {
        count = 6U;
    } else if (shape == CFF_CYLINDER) {
        count = 3U;
    } else {
        /* a ball is one part */
    }
    return count;
}

double cfi_norm(cff_shape_t shape, const double r[3])
{
    double norm = 0.0;
    if (shape == CFF_BOX) {
        norm = cfi_max(cfi_max(fabs(r[0]), fabs(r[1])), fabs(r[2]));
    } else if (shape == CFF_CYLINDER) {
        norm = cfi_max(sqrt((r[0] * r[0]) + (r[1] * r[1])), fabs(r[2]));
    } else {
        norm = sqrt(cfi_dot(r, r));
    }
    return norm;
}

/* The square of the level of a round part. */
static double held(const cfi_piece_t *piece, uint32_t axes)
{
    double size = 0.0;
    for (uint32_t axis = 0U; axis < axes; axis++) {
        size += piece->off[axis] * piece->off[axis];
    }
    const double level = 1.0 + sqrt(size);
    return level * level;
}

/* The coefficients of a part less its level, and their number: it holds where they are negative. */
uint32_t cfi_level(cff_shape_t shape, uint32_t part, const cfi_piece_t *piece, double f[CFF_SQUARE])
{
    const uint32_t axes = cfi_round_axes(shape, part);
    uint32_t count = CFF_TERMS;
    if (axes > 0U) {
        const double level = held(piece, axes);
        count = CFF_SQUARE;
        cfi_square(piece->c, axes, f);
        for (uint32_t k = 0U; k < CFF_SQUARE; k++) {
            f[k] -= level;
        }
    } else {
        double sign;
        const uint32_t axis = flat_axis(shape, part, &sign);
        for (uint32_t k = 0U; k < CFF_TERMS; k++) {
            f[k] = (sign * piece->c[axis][k]) - 1.0 - piece->off[axis];
        }
    }
    return count;
}

/* A part less its level and its rate at u, from coordinates: more precise than from coefficients of squares. */
double cfi_height(cff_shape_t shape, uint32_t part, const cfi_piece_t *piece, double u, double *rate)
{
    const uint32_t axes = cfi_round_axes(shape, part);
    double total = 0.0;
    double slope;
    *rate = 0.0;
    if (axes > 0U) {
        for (uint32_t axis = 0U; axis < axes; axis++) {
            const double value = cfi_value(piece->c[axis], u, &slope);
            total += value * value;
            *rate += 2.0 * value * slope;
        }
        total -= held(piece, axes);
    } else {
        double sign;
        const uint32_t axis = flat_axis(shape, part, &sign);
        total = (sign * cfi_value(piece->c[axis], u, &slope)) - 1.0 - piece->off[axis];
        *rate = sign * slope;
    }
    return total;
}

/* The least and the largest coefficient of an axis. */
void cfi_hull(const double f[CFF_TERMS], double *least, double *most)
{
    *least = f[0];
    *most = f[0];
    for (uint32_t k = 1U; k < CFF_TERMS; k++) {
        *least = cfi_min(*least, f[k]);
        *most = cfi_max(*most, f[k]);
    }
}

/* Whether a plane keeps pieces out of a round part: the plane across the nearest point of the chord of all. */
static bool beyond_plane(const cfi_piece_t pieces[], uint32_t count, uint32_t axes)
{
    const uint32_t last = CFF_TERMS - 1U;
    double w[3] = {0.0, 0.0, 0.0};
    double off = 0.0;
    double square = 0.0;
    double along = 0.0;
    for (uint32_t axis = 0U; axis < axes; axis++) {
        const double way = pieces[count - 1U].c[axis][last] - pieces[0].c[axis][0];
        square += way * way;
        along -= way * pieces[0].c[axis][0];
        off += pieces[0].off[axis];
    }
    along = (along > 0.0) ? cfi_min(along / square, 1.0) : 0.0;
    for (uint32_t axis = 0U; axis < axes; axis++) {
        w[axis] = pieces[0].c[axis][0] + (along * (pieces[count - 1U].c[axis][last] - pieces[0].c[axis][0]));
    }
    double least = CFF_FOREVER;
    for (uint32_t p = 0U; p < count; p++) {
        for (uint32_t k = 0U; k < CFF_TERMS; k++) {
            double height = 0.0;
            for (uint32_t axis = 0U; axis < axes; axis++) {
                height += w[axis] * pieces[p].c[axis][k];
            }
            least = cfi_min(least, height);
        }
    }
    return least > (sqrt(cfi_dot(w, w)) * (1.0 + off) * (1.0 + 1e-14));
}

/* Whether a plane or hulls show that pieces, of one bound of errors, and all between them are outside. */
bool cfi_excluded(cff_shape_t shape, const cfi_piece_t pieces[], uint32_t count)
{
    const uint32_t axes = cfi_round_axes(shape, 0U);
    bool out = false;
    for (uint32_t axis = axes; axis < 3U; axis++) { /* with flat parts */
        double lowest = CFF_FOREVER;
        double highest = -CFF_FOREVER;
        for (uint32_t p = 0U; p < count; p++) {
            double least;
            double most;
            cfi_hull(pieces[p].c[axis], &least, &most);
            lowest = cfi_min(lowest, least);
            highest = cfi_max(highest, most);
        }
        out = out || (cfi_max(lowest, -highest) > (1.0 + pieces[0].off[axis]));
    }
    return out || ((axes > 0U) && beyond_plane(pieces, count, axes));
}

/* A lower bound of the norm over the piece; for a round first part `f` keeps the coefficients of its square. */
double cfi_lower_bound(cff_shape_t shape, const cfi_piece_t *piece, double f[CFF_SQUARE])
{
    const uint32_t axes = cfi_round_axes(shape, 0U);
    double bound = 0.0;
    if (axes > 0U) {
        cfi_square(piece->c, axes, f);
        double least = f[0];
        for (uint32_t k = 1U; k < CFF_SQUARE; k++) {
            least = cfi_min(least, f[k]);
        }
        bound = sqrt(cfi_max(least, 0.0));
    }
    for (uint32_t axis = axes; axis < 3U; axis++) {
        double least;
        double most;
        cfi_hull(piece->c[axis], &least, &most);
        bound = cfi_max(bound, cfi_max(least, -most));
    }
    return bound;
}
