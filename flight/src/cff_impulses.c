/*
 * Minimum delta-v by at most six impulses (theory 27-29; closeform/motion/chief/impulses.py).
 *
 * The cost of impulses that make a change of state is a linear program with a column for each time and direction.  Six
 * columns are a basis: they make the change, and they fix a primer p, a natural motion with p . direction = 1 at each.
 * Where |p| is largest, above 1, an impulse along p enters the basis and the cost falls.  No thrust of any kind costs
 * less than the basis does over the largest |p|: a lower bound, which is known at all times.
 */
#include <math.h>
#include <stddef.h>

#include "cff_internal.h"

#define SIX 6U
#define GAP 1.0e-6        /* between cost and bound, relative: then the plan is final */
#define FINEST 1.0e-8     /* precision of the largest |p|, and as a share of the gap */
#define SHARE 0.05
#define SOLVE_EVALUATIONS 10U
#define NEAR 5.0e-3 /* of the duration: impulses so close become one */
#define LATER 4U    /* second times that are tried for a first basis */

/* The natural motion from a state at one time to another. */
static void coast(const cff_impulses_t *plan, const double state[SIX], double from, double to, double out[SIX])
{
    cff_arc_t arc = {0};
    const cff_path_t path = {&arc, 1U, plan->chief};
    cff_state_t m;
    cff_state_t unused;
    arc.start_s = from;
    arc.end_s = to;
    arc.mean_motion_rad_s = plan->coast.mean_motion_rad_s;
    for (uint32_t i = 0U; i < 3U; i++) {
        arc.state.position_m[i] = state[i];
        arc.state.velocity_m_s[i] = state[i + 3U];
    }
    cfi_arc_motion(&path, 0U, to, &m, &unused);
    for (uint32_t i = 0U; i < 3U; i++) {
        out[i] = m.position_m[i];
        out[i + 3U] = m.velocity_m_s[i];
    }
}

/* Fill in the effect of a unit push on the final state, and of the primer's initial value and rate along it. */
static void fill_push(const cff_impulses_t *plan, cff_push_t *push, uint32_t *evaluations)
{
    double state[SIX] = {0.0, 0.0, 0.0, push->direction[0], push->direction[1], push->direction[2]};
    cfi_spend(evaluations, 7U * cfi_motion_cost(plan->chief));
    coast(plan, state, push->time_s, plan->coast.end_s, push->change);
    for (uint32_t j = 0U; j < SIX; j++) {
        double unit[SIX] = {0};
        unit[j] = 1.0;
        coast(plan, unit, plan->coast.start_s, push->time_s, state);
        push->along[j] = cfi_dot(push->direction, state);
    }
}

/* The shares of the basis in a change of state; false if the basis is singular. */
static bool share_of(const cff_impulses_t *plan, const double change[SIX], double shares[SIX])
{
    double matrix[SIX][SIX];
    double columns[SIX];
    for (uint32_t i = 0U; i < SIX; i++) {
        shares[i] = change[i];
        for (uint32_t k = 0U; k < SIX; k++) {
            matrix[i][k] = plan->basis[k].change[i];
        }
    }
    return cfi_solve(&matrix[0][0], SIX, shares, columns) && cfi_finite(shares, SIX);
}

/* The sizes of the basis, their sum, and the primer; false if the basis is singular. */
static bool price(cff_impulses_t *plan)
{
    double sizes[SIX];
    double primer[SIX];
    double matrix[SIX][SIX];
    double columns[SIX];
    bool good = share_of(plan, plan->change, sizes);
    double total = 0.0;
    for (uint32_t k = 0U; k < SIX; k++) {
        primer[k] = 1.0;
        for (uint32_t j = 0U; j < SIX; j++) {
            matrix[k][j] = plan->basis[k].along[j];
        }
        plan->basis[k].size_m_s = good ? cfi_max(sizes[k], 0.0) : 0.0;
        total += plan->basis[k].size_m_s;
    }
    good = good && cfi_solve(&matrix[0][0], SIX, primer, columns) && cfi_finite(primer, SIX);
    for (uint32_t i = 0U; i < 3U; i++) {
        plan->primer.state.position_m[i] = primer[i];
        plan->primer.state.velocity_m_s[i] = primer[i + 3U];
    }
    plan->cost_m_s = good ? total : plan->cost_m_s;
    return good;
}

/* A first basis: along the axes at the start and at a later time, with the signs that the change needs. */
static bool begin_basis(cff_impulses_t *plan, uint32_t *evaluations)
{
    const double length = plan->coast.end_s - plan->coast.start_s;
    bool good = false;
    for (uint32_t turn = 0U; (turn < LATER) && !good; turn++) {
        double sizes[SIX];
        for (uint32_t k = 0U; k < SIX; k++) {
            cff_push_t *push = &plan->basis[k];
            push->time_s = plan->coast.start_s + ((k < 3U) ? 0.0 : (length * (1.0 - (0.17 * (double)turn))));
            for (uint32_t i = 0U; i < 3U; i++) {
                push->direction[i] = ((k % 3U) == i) ? 1.0 : 0.0;
            }
            fill_push(plan, push, evaluations);
        }
        good = share_of(plan, plan->change, sizes);
        for (uint32_t k = 0U; (k < SIX) && good; k++) {
            const double sign = (sizes[k] < 0.0) ? -1.0 : 1.0;
            plan->basis[k].direction[k % 3U] = sign;
            for (uint32_t i = 0U; i < SIX; i++) {
                plan->basis[k].change[i] *= sign;
                plan->basis[k].along[i] *= sign;
            }
        }
        good = good && price(plan);
    }
    return good;
}

/* Begin to look for where |p| is largest. */
static void begin_scan(cff_impulses_t *plan)
{
    plan->scanned_s = plan->coast.start_s;
    plan->low = 0.0;
    plan->width = 1.0;
    plan->peak_count = 0U;
    plan->peaks[0].size_m_s = 1.0;
}

/* Note |p| at an end of a piece if it is the largest of its view. */
static void note(cff_impulses_t *plan, const cfi_view_t *view, const cfi_piece_t *piece, bool at_end)
{
    cff_push_t *peak = &plan->peaks[plan->peak_count];
    const uint32_t last = CFF_TERMS - 1U;
    const uint32_t k = at_end ? last : 0U;
    const double p[3] = {piece->c[0][k], piece->c[1][k], piece->c[2][k]};
    const double size = sqrt(cfi_dot(p, p));
    if (size > peak->size_m_s) {
        peak->size_m_s = size;
        peak->time_s = cfi_time_in(view, piece->low + (at_end ? piece->width : 0.0));
        for (uint32_t i = 0U; i < 3U; i++) {
            peak->direction[i] = p[i] / size;
        }
    }
}

/* Keep the peak of a view: of too many the lowest goes. */
static void keep_peak(cff_impulses_t *plan)
{
    if (plan->peaks[plan->peak_count].size_m_s > 1.0) {
        uint32_t lowest = plan->peak_count;
        plan->peak_count++;
        for (uint32_t k = 0U; (plan->peak_count == CFF_MOST_PEAKS) && (k < CFF_MOST_PEAKS); k++) {
            lowest = (plan->peaks[k].size_m_s < plan->peaks[lowest].size_m_s) ? k : lowest;
        }
        if (plan->peak_count == CFF_MOST_PEAKS) {
            plan->peak_count--;
            plan->peaks[lowest] = plan->peaks[plan->peak_count];
        }
    }
    plan->peaks[plan->peak_count].size_m_s = 1.0;
}

/* An upper bound of |p| over a piece. */
static double upper_bound(const cfi_piece_t *piece)
{
    double f[CFF_SQUARE];
    double most = 0.0;
    cfi_square(piece->c, 3U, f);
    for (uint32_t k = 0U; k < CFF_SQUARE; k++) {
        most = cfi_max(most, f[k]);
    }
    return sqrt(most) + ((piece->off[0] + piece->off[1]) + piece->off[2]);
}

/* Search a view for where |p| is largest, piece by piece; false if the evaluations are spent before its end. */
static bool scan_view(cff_impulses_t *plan, const cfi_view_t *view, double precision, uint32_t *evaluations)
{
    cfi_piece_t piece;
    bool on = true;
    piece.low = plan->low;
    piece.width = plan->width;
    while (on && (*evaluations >= CFF_PIECE_EVALUATIONS)) { /* each turn costs evaluations */
        cfi_spend(evaluations, CFF_PIECE_EVALUATIONS);
        cfi_take_piece(view, &piece);
        note(plan, view, &piece, false);
        note(plan, view, &piece, true);
        if ((upper_bound(&piece) <= (plan->peaks[plan->peak_count].size_m_s * (1.0 + precision))) || !cfi_halve_piece(&piece)) {
            on = cfi_next_interval(&piece.low, &piece.width);
        }
    }
    plan->low = on ? piece.low : 0.0;
    plan->width = on ? piece.width : 1.0;
    return !on;
}

/* Go on to look for where |p| is largest; false if the evaluations are spent before the end. */
static bool scan(cff_impulses_t *plan, double precision, uint32_t *evaluations)
{
    const cff_path_t path = {&plan->primer, 1U, plan->chief};
    const double end = plan->primer.end_s;
    cff_cursor_t place;
    bool on = true;
    cfi_begin_place(&path, &place, plan->scanned_s);
    while (on && (plan->scanned_s < end)) { /* each turn costs evaluations */
        cfi_view_t view;
        cfi_spend(evaluations, cfi_view_cost(&path));
        cfi_see_coast(&path, &place, plan->scanned_s, end, &view);
        on = scan_view(plan, &view, precision, evaluations);
        if (on) {
            keep_peak(plan);
            plan->scanned_s = (view.until_s > plan->scanned_s) ? view.until_s : end;
        }
    }
    return on;
}

/* Bring an impulse along a peak into the basis; false if it does not lower the cost any more. */
static bool enter(cff_impulses_t *plan, uint32_t peak, uint32_t *evaluations)
{
    cff_push_t *push = &plan->peaks[peak];
    double shares[SIX];
    double step = CFF_FOREVER;
    uint32_t leaves = SIX;
    fill_push(plan, push, evaluations);
    cfi_spend(evaluations, SOLVE_EVALUATIONS);
    const double worth = cfi_dot(push->along, plan->primer.state.position_m) +
                         cfi_dot(&push->along[3], plan->primer.state.velocity_m_s);
    bool good = (worth > (1.0 + FINEST)) && share_of(plan, push->change, shares);
    for (uint32_t k = 0U; (k < SIX) && good; k++) {
        const double size = plan->basis[k].size_m_s;
        const bool falls = (shares[k] > 1e-9);
        if (falls && ((leaves == SIX) || (size < (step * shares[k])) ||
                      ((size <= (step * shares[k])) && (shares[k] > shares[leaves])))) {
            step = size / shares[k];
            leaves = k;
        }
    }
    if (leaves < SIX) {
        const cff_push_t kept = plan->basis[leaves];
        plan->basis[leaves] = *push;
        good = price(plan);
        if (!good) {
            plan->basis[leaves] = kept;
            (void)price(plan);
        }
    }
    return good && (leaves < SIX);
}

/* Bring impulses along all peaks into the basis, the highest first; false if none lowers the cost. */
static bool enter_all(cff_impulses_t *plan, uint32_t *evaluations)
{
    bool any = false;
    for (uint32_t turn = 0U; (turn < plan->peak_count) && (*evaluations > 0U); turn++) {
        uint32_t highest = 0U;
        for (uint32_t k = 1U; k < plan->peak_count; k++) {
            highest = (plan->peaks[k].size_m_s > plan->peaks[highest].size_m_s) ? k : highest;
        }
        any = enter(plan, highest, evaluations) || any;
        plan->peaks[highest].size_m_s = 0.0;
    }
    return any;
}

/* Order the basis by time. */
static void sort_basis(cff_impulses_t *plan)
{
    for (uint32_t k = 1U; k < SIX; k++) {
        const cff_push_t push = plan->basis[k];
        uint32_t m = k;
        while ((m > 0U) && (plan->basis[m - 1U].time_s > push.time_s)) { /* at most 5 turns */
            plan->basis[m] = plan->basis[m - 1U];
            m--;
        }
        plan->basis[m] = push;
    }
}

/* The impulses of the basis, those up to `near` behind another joined to one at their mean time; how many there are. */
static uint32_t gather(const cff_impulses_t *plan, double near, cff_impulse_t made[SIX])
{
    uint32_t count = 0U;
    double first = 0.0;
    double sizes = 0.0;
    for (uint32_t k = 0U; k < SIX; k++) {
        const cff_push_t *push = &plan->basis[k];
        if (push->size_m_s > (1e-14 * plan->cost_m_s)) {
            if ((count == 0U) || ((push->time_s - first) > near)) {
                const cff_impulse_t none = {push->time_s, {0.0, 0.0, 0.0}};
                made[count] = none;
                first = push->time_s;
                sizes = 0.0;
                count++;
            }
            cff_impulse_t *impulse = &made[count - 1U];
            sizes += push->size_m_s;
            impulse->time_s += (push->size_m_s / sizes) * (push->time_s - impulse->time_s);
            for (uint32_t i = 0U; i < 3U; i++) {
                impulse->delta_v_m_s[i] += push->size_m_s * push->direction[i];
            }
        }
    }
    return count;
}

static double total_of(const cff_impulse_t made[SIX], uint32_t count)
{
    double total = 0.0;
    for (uint32_t k = 0U; k < count; k++) {
        total += sqrt(cfi_dot(made[k].delta_v_m_s, made[k].delta_v_m_s));
    }
    return total;
}

/* The change of the final state by a unit impulse along an axis. */
static void effect_of(const cff_impulses_t *plan, double time, uint32_t axis, double effect[SIX])
{
    double unit[SIX] = {0};
    unit[3U + axis] = 1.0;
    coast(plan, unit, time, plan->coast.end_s, effect);
}

/* Change impulses as little as possible so that they make the change of state; false if they cannot. */
static bool correct(const cff_impulses_t *plan, cff_impulse_t made[SIX], uint32_t count)
{
    double normal[SIX][SIX] = {0};
    double rest[SIX];
    double columns[SIX];
    for (uint32_t i = 0U; i < SIX; i++) {
        rest[i] = plan->change[i];
    }
    for (uint32_t k = 0U; k < count; k++) {
        const double size = sqrt(cfi_dot(made[k].delta_v_m_s, made[k].delta_v_m_s));
        for (uint32_t axis = 0U; axis < 3U; axis++) {
            double effect[SIX];
            effect_of(plan, made[k].time_s, axis, effect);
            for (uint32_t i = 0U; i < SIX; i++) {
                rest[i] -= made[k].delta_v_m_s[axis] * effect[i];
                for (uint32_t j = 0U; j < SIX; j++) {
                    normal[i][j] += size * effect[i] * effect[j];
                }
            }
        }
    }
    const bool good = (count > 1U) && cfi_solve(&normal[0][0], SIX, rest, columns) && cfi_finite(rest, SIX);
    for (uint32_t k = 0U; (k < count) && good; k++) {
        const double size = sqrt(cfi_dot(made[k].delta_v_m_s, made[k].delta_v_m_s));
        for (uint32_t axis = 0U; axis < 3U; axis++) {
            double effect[SIX];
            effect_of(plan, made[k].time_s, axis, effect);
            for (uint32_t i = 0U; i < SIX; i++) {
                made[k].delta_v_m_s[axis] += size * effect[i] * rest[i];
            }
        }
    }
    return good;
}

/* Write the coasts between impulses. */
static void write_arcs(cff_impulses_t *plan, const cff_impulse_t made[SIX], uint32_t count)
{
    const cff_path_t path = {plan->arcs, SIX + 1U, plan->chief};
    plan->arcs[0] = plan->coast;
    plan->count = 1U;
    for (uint32_t k = 0U; k < count; k++) {
        cff_arc_t *arc = &plan->arcs[plan->count - 1U];
        if (made[k].time_s > (arc->start_s + CFF_SHORTEST_S)) {
            cff_state_t m;
            cff_state_t unused;
            cff_arc_t *next = &plan->arcs[plan->count];
            cfi_arc_motion(&path, plan->count - 1U, made[k].time_s, &m, &unused);
            *next = plan->coast;
            arc->end_s = made[k].time_s;
            next->start_s = made[k].time_s;
            next->state = m;
            arc = next;
            plan->count++;
        }
        for (uint32_t i = 0U; i < 3U; i++) {
            arc->impulse_m_s[i] += made[k].delta_v_m_s[i];
            arc->state.velocity_m_s[i] += made[k].delta_v_m_s[i];
        }
    }
}

/* Write the plan: with neighbours joined if that costs no more than the precision, else as the basis is. */
static void write_plan(cff_impulses_t *plan, uint32_t *evaluations)
{
    const double near = NEAR * (plan->coast.end_s - plan->coast.start_s);
    cff_impulse_t made[SIX];
    cfi_spend(evaluations, 42U * cfi_motion_cost(plan->chief));
    sort_basis(plan);
    uint32_t count = gather(plan, near, made);
    const double most = cfi_max(plan->cost_m_s, plan->lower_bound_m_s * (1.0 + GAP));
    if (!correct(plan, made, count) || !(total_of(made, count) <= most)) {
        count = gather(plan, 0.0, made);
    }
    plan->delta_v_m_s = total_of(made, count);
    write_arcs(plan, made, count);
}

cff_status_t cff_impulses_begin(cff_impulses_t *plan, const cff_table_t *chief, double mean_motion_rad_s, double start_s,
                                double duration_s, const cff_state_t *initial, const cff_state_t *final)
{
    cff_arc_t arc;
    cff_status_t status = cfi_state_finite(final) ? CFF_OK : CFF_BAD_INPUT;
    if ((status == CFF_OK) && (chief != NULL)) {
        status = cff_drift_beside(chief, start_s, duration_s, initial, &arc);
    } else if (status == CFF_OK) {
        status = cff_drift(mean_motion_rad_s, start_s, duration_s, initial, &arc);
    } else {
        /* refused */
    }
    if (status == CFF_OK) {
        const cff_path_t path = {&arc, 1U, chief};
        cff_state_t m;
        cff_state_t unused;
        uint32_t unpaid = 0U; /* the work of beginning has a bound */
        cfi_arc_motion(&path, 0U, arc.end_s, &m, &unused);
        plan->chief = chief;
        plan->coast = arc;
        plan->primer = arc;
        cfi_miss(final, &m, plan->change);
        plan->cost_m_s = 0.0;
        plan->lower_bound_m_s = 0.0;
        plan->evaluations_used = 0U;
        plan->finished = false;
        if (begin_basis(plan, &unpaid)) {
            begin_scan(plan);
            write_plan(plan, &unpaid);
        } else {
            status = CFF_SINGULAR;
        }
    }
    return status;
}

/* Take up a finished scan: a bound, and a better basis unless the plan is final; false if rounding prevents one. */
static bool improve(cff_impulses_t *plan, double precision, uint32_t *evaluations)
{
    double highest = 1.0;
    bool good = true;
    for (uint32_t k = 0U; k < plan->peak_count; k++) {
        highest = cfi_max(highest, plan->peaks[k].size_m_s);
    }
    plan->lower_bound_m_s = cfi_max(plan->lower_bound_m_s, plan->cost_m_s / (highest * (1.0 + precision)));
    plan->finished = (plan->cost_m_s <= (plan->lower_bound_m_s * (1.0 + GAP)));
    if (!plan->finished) {
        good = enter_all(plan, evaluations) || (highest <= (1.0 + (2.0 * precision)));
        begin_scan(plan);
    }
    return good;
}

cff_status_t cff_impulses_continue(cff_impulses_t *plan, uint32_t evaluations)
{
    cff_status_t status = (evaluations >= CFF_LEAST_EVALUATIONS) ? CFF_OK : CFF_BAD_INPUT;
    uint32_t left = evaluations;
    const bool begun = (status == CFF_OK) && !plan->finished;
    while ((status == CFF_OK) && !plan->finished) { /* each turn costs evaluations */
        const double gap = (plan->cost_m_s - plan->lower_bound_m_s) / cfi_max(plan->cost_m_s, 1e-300);
        const double precision = cfi_min(cfi_max(SHARE * gap, FINEST), 1e-2);
        if (!scan(plan, precision, &left) || (left < CFF_LEAST_EVALUATIONS)) {
            status = CFF_MORE;
        } else if (!improve(plan, precision, &left)) {
            status = CFF_SINGULAR;
        } else {
            /* once more, or the plan is final */
        }
    }
    if (begun) {
        write_plan(plan, &left);
        plan->evaluations_used += evaluations - left;
    }
    return status;
}
