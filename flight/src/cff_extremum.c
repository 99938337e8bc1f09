/*
 * Certified minimum norm along one view (closeform/conflicts/chief/minimum_norm.py).
 *
 * A piece is done where its lower bound is no lower than the best norm found.  It is also done where each
 * part of the zone that can be the largest is a valley: the coefficients of its slope change signs at most
 * once, from falling to rising.  The maximum of valleys is a valley, and the slope of the part that is the
 * largest tells on which side its bottom lies.  Other pieces are halved.
 */
#include <math.h>

#include "cff_internal.h"

#define PRECISION 1.0e-10 /* a minimum norm is certain to this fraction of itself */
#define NIL 1.0e-13       /* a norm below counts as 0 */
#define FLAT 1.0e-9       /* a slope, by the size of norms at the ends */
#define ROOT_STEPS 100U
static const uint32_t HALVINGS[2] = {8U, 2U}; /* every how many steps a bracket is halved: a kink has no slope to follow */

/* The norm at u, and a number with the sign of its slope. */
static double norm_and_slope(const cfi_piece_t *piece, cff_shape_t shape, double u, double *slope)
{
    const uint32_t axes = cfi_round_axes(shape, 0U);
    double best = -1.0;
    double square = 0.0;
    double half = 0.0;
    *slope = 0.0;
    for (uint32_t axis = 0U; axis < 3U; axis++) {
        double rate;
        const double value = cfi_value(piece->c[axis], u, &rate);
        if (axis < axes) {
            square += value * value;
            half += value * rate;
            if ((axis + 1U) == axes) {
                best = sqrt(square);
                *slope = half;
            }
        } else if (fabs(value) > best) {
            best = fabs(value);
            *slope = (value > 0.0) ? rate : -rate;
        } else {
            /* another part is larger */
        }
    }
    return best;
}

/* The bottom of a valley and the norm there: regula falsi in a bracket (Illinois), at times the middle. */
static double bottom(const cfi_piece_t *piece, cff_shape_t shape, double *norm, uint32_t *evaluations)
{
    const uint32_t halving = HALVINGS[(shape == CFF_ELLIPSOID) ? 0 : 1];
    double low = 0.0;
    double high = 1.0;
    double falls;
    double rises;
    double u = 1.0;
    const double first = norm_and_slope(piece, shape, 0.0, &falls);
    *norm = norm_and_slope(piece, shape, 1.0, &rises);
    const double size = first + *norm;
    const double nothing = FLAT * size * cfi_max(size, 1.0); /* a slope of 0 at an end says nothing, nor its rounding */
    bool on = (rises >= -nothing) && (falls <= nothing);
    falls = (falls < -nothing) ? falls : 0.0;
    rises = (rises > nothing) ? rises : 0.0;
    for (uint32_t k = 0U; (k < ROOT_STEPS) && on; k++) {
        const double before = u;
        double slope;
        cfi_spend(evaluations, 1U);
        u = low + ((high - low) * falls / (falls - rises));
        if (!((u > low) && (u < high)) || ((k % halving) == (halving - 1U))) {
            u = 0.5 * (low + high);
        }
        *norm = norm_and_slope(piece, shape, u, &slope);
        if (slope < 0.0) {
            low = u;
            falls = slope;
            rises *= 0.5;
        } else {
            high = u;
            rises = slope;
            falls *= 0.5;
        }
        on = ((high - low) > 1e-14) && (fabs(u - before) > 1e-14) && (slope != 0.0);
    }
    return u;
}

/* Whether coefficients, times a sign, fall, rise, or first fall and then rise. */
static bool is_valley(const double f[], uint32_t count, double sign)
{
    bool rises = false;
    bool valley = true;
    for (uint32_t k = 0U; (k + 1U) < count; k++) {
        const double slope = sign * (f[k + 1U] - f[k]);
        rises = rises || (slope > 0.0);
        valley = valley && !(rises && (slope < 0.0));
    }
    return valley;
}

/* Whether each part of the zone that can be above `bound` is a valley; `f` are the coefficients of a square. */
static bool all_valleys(const cfi_piece_t *piece, cff_shape_t shape, const double f[CFF_SQUARE], double bound)
{
    const uint32_t axes = cfi_round_axes(shape, 0U);
    bool valley = (axes == 0U) || is_valley(f, CFF_SQUARE, 1.0);
    for (uint32_t axis = axes; axis < 3U; axis++) {
        double least;
        double most;
        cfi_hull(piece->c[axis], &least, &most);
        if (cfi_max(-least, most) > bound) {
            const double sign = (least > 0.0) ? 1.0 : -1.0;
            valley = valley && ((least > 0.0) || (most < 0.0)) && is_valley(piece->c[axis], CFF_TERMS, sign);
        }
    }
    return valley;
}

static void keep(double norm, double u, double *best, double *best_u)
{
    if (norm < (*best * (1.0 - (0.1 * PRECISION)))) { /* of equals the first, as orbit after orbit */
        *best = norm;
        *best_u = u;
    }
}

/* The norm at an end of a piece. */
static void keep_end(const cfi_piece_t *piece, cff_shape_t shape, bool at_end, double *best, double *best_u)
{
    const uint32_t last = CFF_TERMS - 1U;
    const uint32_t k = at_end ? last : 0U;
    const double r[3] = {piece->c[0][k], piece->c[1][k], piece->c[2][k]};
    keep(cfi_norm(shape, r), piece->low + (at_end ? piece->width : 0.0), best, best_u);
}

/*
 * The minimum norm over a view, if below `best`.  Returns how far the view was searched: less than 1 where the
 * evaluations are spent.
 */
double cfi_minimum(const cfi_view_t *view, cff_shape_t shape, double *best, double *best_u, uint32_t *evaluations)
{
    cfi_piece_t piece;
    bool on = true;
    piece.low = 0.0;
    piece.width = 1.0;
    while (on && (*evaluations >= CFF_PIECE_EVALUATIONS)) { /* each turn costs evaluations */
        double f[CFF_SQUARE] = {0};
        bool done = true;
        cfi_spend(evaluations, CFF_PIECE_EVALUATIONS);
        cfi_take_piece(view, &piece);
        keep_end(&piece, shape, false, best, best_u);
        keep_end(&piece, shape, true, best, best_u);
        const double bound = cfi_lower_bound(shape, &piece, f);
        if (*best <= NIL) {
            *best = 0.0; /* there is no less */
            piece.low = 1.0;
            on = false;
        } else if (bound >= (*best * (1.0 - PRECISION))) {
            /* nothing nearer */
        } else if (all_valleys(&piece, shape, f, bound)) {
            double norm;
            const double u = bottom(&piece, shape, &norm, evaluations);
            keep(norm, piece.low + (u * piece.width), best, best_u);
        } else {
            done = !cfi_halve_piece(&piece);
        }
        if (on && done) {
            on = cfi_next_interval(&piece.low, &piece.width);
        }
    }
    return cfi_min(piece.low, 1.0);
}
