/*
 * The times inside a zone along one view (closeform/conflicts/chief/sign_changes.py).
 *
 * A view is searched piece by piece.  A piece is outside if hulls show it, and decided if the coefficients of
 * each part of the zone change signs at most once: then a part begins or ceases to hold at one root
 * (Descartes' rule), and the piece is inside between the last beginning and the first end.  Others are halved.
 */
#include <math.h>

#include "cff_internal.h"

#define LEVEL 1.0e-13    /* within it a squared norm is on the surface: the rounding of positions of a zone's size */
#define SAME 1.0e-12     /* conflicts that follow each other so soon, relative to the time, are one */
#define ROOT_STEPS 60U

/* State of a part over a piece, by the signs of its coefficients. */
typedef enum { OUT, IN, ENTERS, LEAVES, OPEN } part_state_t;

static part_state_t judge(const double f[], uint32_t count, bool narrow)
{
    double least = f[0];
    double most = f[0];
    double last = 0.0;
    double first = 0.0;
    uint32_t changes = 0U;
    for (uint32_t k = 0U; k < count; k++) {
        least = cfi_min(least, f[k]);
        most = cfi_max(most, f[k]);
        if (f[k] != 0.0) {
            changes += ((last != 0.0) && ((f[k] > 0.0) != (last > 0.0))) ? 1U : 0U;
            first = (last == 0.0) ? f[k] : first;
            last = f[k];
        }
    }
    const double level = LEVEL + (CFF_ROUNDING * cfi_max(fabs(least), fabs(most)));
    part_state_t state = OPEN;
    if (changes == 0U) {
        state = (most > 0.0) ? OUT : IN;
    } else if (changes == 1U) {
        state = (first > 0.0) ? ENTERS : LEAVES;
    } else if (narrow || ((most <= level) && (least >= -level))) {
        state = IN; /* it touches the level within rounding */
    } else {
        /* open */
    }
    return state;
}

/* The only root of a part, by Newton's method in a bracket: it ends where steps are rounding. */
static double root(cff_shape_t shape, uint32_t part, const cfi_piece_t *piece, bool rising, uint32_t *evaluations)
{
    double low = 0.0;
    double high = 1.0;
    double last = 1.0;
    double u = 0.5;
    bool on = true;
    for (uint32_t k = 0U; (k < ROOT_STEPS) && on; k++) {
        double rate;
        const double value = cfi_height(shape, part, piece, u, &rate);
        cfi_spend(evaluations, 1U);
        if ((value > 0.0) == rising) {
            high = u;
        } else {
            low = u;
        }
        double there = (rate != 0.0) ? (u - (value / rate)) : -1.0;
        if (!((there > low) && (there < high))) {
            there = 0.5 * (low + high);
        }
        const double step = fabs(there - u);
        on = (step > 2e-16) && !((step < 1e-12) && ((2.0 * step) >= last));
        u = there;
        last = step;
    }
    return u;
}

/* The times at which a piece is inside, in [0, 1], `low` >= `high` if never; false if it is to be halved. */
static bool decide(cff_shape_t shape, const cfi_piece_t *piece, bool narrow, double *low, double *high, uint32_t *evaluations)
{
    part_state_t states[6] = {OUT, OUT, OUT, OUT, OUT, OUT};
    bool decided = true;
    bool out = cfi_excluded(shape, piece, 1U);
    *low = 0.0;
    *high = 1.0;
    for (uint32_t part = 0U; (part < cfi_part_count(shape)) && !out; part++) {
        double f[CFF_SQUARE] = {0};
        const uint32_t count = cfi_level(shape, part, piece, f);
        states[part] = judge(f, count, narrow);
        out = (states[part] == OUT);
        decided = decided && (states[part] != OPEN);
    }
    for (uint32_t part = 0U; (part < cfi_part_count(shape)) && decided && !out; part++) {
        if (states[part] == ENTERS) {
            *low = cfi_max(*low, root(shape, part, piece, false, evaluations));
        } else if (states[part] == LEAVES) {
            *high = cfi_min(*high, root(shape, part, piece, true, evaluations));
        } else {
            /* it holds everywhere */
        }
    }
    if (out) {
        *low = 1.0;
        *high = 0.0;
    }
    return decided || out;
}

/* Append the open conflict; false if there is no space. */
bool cfi_close_conflict(cff_conflict_search_t *search, cff_conflict_t conflicts[], uint32_t capacity, uint32_t *count)
{
    bool space = false;
    if (*count < capacity) {
        conflicts[*count].start_s = search->entry_s;
        conflicts[*count].end_s = search->exit_s;
        *count += 1U;
        search->inside = false;
        space = true;
    }
    return space;
}

/* Add the time inside of a piece that ends at `end`; false if an earlier conflict finds no space. */
static bool add_piece(cff_conflict_search_t *search, const cfi_view_t *view, const cfi_piece_t *piece, double low,
                      double high, cff_conflict_t conflicts[], uint32_t capacity, uint32_t *count)
{
    const double entry = cfi_time_in(view, piece->low + (low * piece->width));
    const double end = cfi_time_in(view, piece->low + piece->width);
    const double gap = SAME * (1.0 + fabs(end));
    const bool some = (low < high) || ((low <= high) && (view->length <= 0.0));
    const double next = some ? entry : end;
    bool space = true;
    if (search->inside && (next > (search->exit_s + gap))) {
        space = cfi_close_conflict(search, conflicts, capacity, count);
    }
    if (space && some) {
        search->entry_s = search->inside ? search->entry_s : entry;
        search->exit_s = cfi_time_in(view, piece->low + (high * piece->width));
        search->inside = true;
    }
    if (space) {
        search->certified_until_s = end;
    }
    return space;
}

/* Search one view, until its end or until the evaluations or the space are spent; false for the latter. */
bool cfi_search_view(cff_conflict_search_t *search, const cfi_view_t *view, cff_conflict_t conflicts[], uint32_t capacity,
                     uint32_t *count, uint32_t *evaluations)
{
    cfi_piece_t piece;
    bool space = true;
    bool on = true;
    piece.low = 0.0;
    piece.width = 1.0;
    while (((piece.width * view->length) > search->step) && cfi_halve_piece(&piece)) { /* at most 30 turns */
        /* go on with the width with which the evaluations ended */
    }
    while (on && space && (*evaluations >= CFF_PIECE_EVALUATIONS)) { /* each turn costs evaluations */
        double low;
        double high;
        const bool narrow = ((piece.width * CFF_FINEST) <= 1.0);
        cfi_spend(evaluations, CFF_PIECE_EVALUATIONS);
        cfi_take_piece(view, &piece);
        if (decide(search->zone->shape, &piece, narrow, &low, &high, evaluations)) {
            space = add_piece(search, view, &piece, low, high, conflicts, capacity, count);
            on = cfi_next_interval(&piece.low, &piece.width);
        } else {
            (void)cfi_halve_piece(&piece);
        }
    }
    search->step = on ? (piece.width * view->length) : CFF_FOREVER;
    return space;
}
