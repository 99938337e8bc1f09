/*
 * Arcs and paths: states, thrust, and derivatives of positions (closeform/motion/arc.py, path.py).
 */
#include <math.h>
#include <stddef.h>

#include "cff_internal.h"

typedef char cfi_arc_is_thirty_doubles[(sizeof(cff_arc_t) == (30U * sizeof(double))) ? 1 : -1];

#define JOINT 1.0e-9      /* of the size of the numbers: largest gap between two arcs where they meet */
#define CFF_NIL_M 1.0e-12 /* a joint that is no joint */

/* Finite and of a size whose squares do not overflow; not so of nan. */
bool cfi_finite(const double numbers[], uint32_t count)
{
    bool good = true;
    for (uint32_t k = 0U; k < count; k++) {
        if (!(fabs(numbers[k]) <= CFF_LARGEST)) {
            good = false;
        }
    }
    return good;
}

bool cfi_state_finite(const cff_state_t *state)
{
    return cfi_finite(state->position_m, 3U) && cfi_finite(state->velocity_m_s, 3U);
}

static bool any(const double v[3]) { return (v[0] != 0.0) || (v[1] != 0.0) || (v[2] != 0.0); }

/* Whether an optimal thrust acts along the arc. */
static bool has_primer(const cff_arc_t *arc) { return any(arc->thrust_m_s2) || any(arc->thrust_rate_m_s3); }

/* Whether the push turns or bends: beyond its value and its rate. */
static bool push_bends(const cff_arc_t *arc) { return any(arc->push_bend_m_s4) || any(arc->push_twist_m_s5); }

/* Whether another thrust acts along the arc. */
bool cfi_pushes(const cff_arc_t *arc)
{
    return any(arc->push_m_s2) || any(arc->push_rate_m_s3) || push_bends(arc);
}

bool cfi_thrusts(const cff_arc_t *arc) { return has_primer(arc) || cfi_pushes(arc); }

/* State at time t, absolute, within the arc. */
void cfi_state(const cff_arc_t *arc, double t, cff_state_t *out)
{
    const double dt = t - arc->start_s;
    const double n = arc->mean_motion_rad_s;
    if (dt != 0.0) {
        double p[3];
        cfi_oscillation(n, dt, p);
        cfi_coast(n, dt, p, arc->state.position_m, arc->state.velocity_m_s, out);
        if (cfi_thrusts(arc)) {
            cfi_transforms_t k;
            cfi_transforms(n, dt, &k);
            if (has_primer(arc)) {
                cfi_add_driven(n, dt, &k, arc->thrust_m_s2, arc->thrust_rate_m_s3, out);
            }
            if (cfi_pushes(arc)) {
                cfi_add_pushed(n, dt, &k, arc, out);
            }
        }
    } else {
        *out = arc->state;
    }
}

/* Optimal thrust and its rate at time t: itself a natural motion. */
void cfi_primer(const cff_arc_t *arc, double t, cff_state_t *out)
{
    double p[3];
    const double dt = t - arc->start_s;
    cfi_oscillation(arc->mean_motion_rad_s, dt, p);
    cfi_coast(arc->mean_motion_rad_s, dt, p, arc->thrust_m_s2, arc->thrust_rate_m_s3, out);
}

/* The push at time t and its first three derivatives. */
static void push(const cff_arc_t *arc, double t, double out[4][3])
{
    const double n = arc->mean_motion_rad_s;
    const double dt = t - arc->start_s;
    double p[3];
    cfi_oscillation(n, dt, p);
    const double c = 1.0 - (n * n * p[1]);
    for (uint32_t i = 0U; i < 3U; i++) {
        const double bend = arc->push_bend_m_s4[i];
        const double twist = arc->push_twist_m_s5[i];
        const double rate = arc->push_rate_m_s3[i];
        out[0][i] = arc->push_m_s2[i] + (rate * dt) + (bend * p[1]) + (twist * p[2]);
        out[1][i] = rate + (bend * p[0]) + (twist * p[1]);
        out[2][i] = (bend * c) + (twist * p[0]);
        out[3][i] = (twist * c) - (n * n * bend * p[0]);
    }
}

/* Add `sign` times the first powers of the motion of an arc from time t on, in units of a time h. */
void cfi_add_start(const cff_arc_t *arc, double t, double h, double sign, cfi_start_t *out)
{
    const double hh = sign * h * h;
    cff_state_t m;
    cff_state_t u = {0};
    double f[4][3] = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    cfi_state(arc, t, &m);
    if (has_primer(arc)) {
        cfi_primer(arc, t, &u);
    }
    if (cfi_pushes(arc)) {
        push(arc, t, f);
    }
    for (uint32_t i = 0U; i < 3U; i++) {
        out->r[i] += sign * m.position_m[i];
        out->v[i] += sign * h * m.velocity_m_s[i];
        out->u[i] += hh * u.position_m[i];
        out->w[i] += hh * h * u.velocity_m_s[i];
        out->push[0][i] += hh * f[0][i];
        out->push[1][i] += hh * h * f[1][i];
        out->push[2][i] += hh * h * h * f[2][i] / 2.0;
        out->push[3][i] += hh * h * h * h * f[3][i] / 6.0;
    }
}

/* The arc in which the motion goes on after time t, by halves. */
uint32_t cfi_locate(const cff_path_t *path, double t)
{
    uint32_t first = 0U;
    for (uint32_t step = CFF_MOST_ARCS / 2U; step > 0U; step /= 2U) {
        if (((first + step) < path->count) && (path->arcs[first + step].start_s <= t)) {
            first += step;
        }
    }
    return first;
}

/* State and optimal thrust of an arc at time t. */
void cfi_arc_motion(const cff_path_t *path, uint32_t k, double t, cff_state_t *state, cff_state_t *primer)
{
    const cff_arc_t *arc = &path->arcs[k];
    if (path->chief != NULL) {
        cfi_arc_state(path->chief, arc, t, state, primer);
    } else {
        cfi_state(arc, t, state);
        cfi_primer(arc, t, primer);
    }
}

/* How far a state is from another: position and velocity. */
void cfi_miss(const cff_state_t *wanted, const cff_state_t *reached, double gap[6])
{
    for (uint32_t i = 0U; i < 3U; i++) {
        gap[i] = wanted->position_m[i] - reached->position_m[i];
        gap[i + 3U] = wanted->velocity_m_s[i] - reached->velocity_m_s[i];
    }
}

/* Whether an arc goes on from where the one before it ends. */
static bool joins(const cff_path_t *path, uint32_t k)
{
    const cff_arc_t *before = &path->arcs[k - 1U];
    const cff_arc_t *arc = &path->arcs[k];
    const double duration = before->end_s - before->start_s;
    cff_state_t m;
    cff_state_t u;
    double size = 0.0;
    double off = 0.0;
    cfi_arc_motion(path, k - 1U, before->end_s, &m, &u);
    for (uint32_t i = 0U; i < 3U; i++) {
        size = cfi_max(size, cfi_max(fabs(m.position_m[i]), fabs(m.velocity_m_s[i]) * duration));
        size = cfi_max(size, fabs(arc->state.velocity_m_s[i]) * (arc->end_s - arc->start_s));
        off = cfi_max(off, fabs(m.position_m[i] - arc->state.position_m[i]));
    }
    return (off <= ((2.0 * JOINT * size) + CFF_NIL_M)) && (fabs(arc->start_s - before->end_s) <= (JOINT * duration));
}

static bool arc_is_good(const cff_path_t *path, uint32_t k)
{
    const cff_arc_t *arc = &path->arcs[k];
    const double duration = arc->end_s - arc->start_s;
    bool good = cfi_finite(&arc->start_s, 2U) && cfi_finite(arc->impulse_m_s, 3U) && cfi_state_finite(&arc->state);
    good = good && cfi_finite(arc->thrust_m_s2, 3U) && cfi_finite(arc->thrust_rate_m_s3, 3U);
    good = good && cfi_finite(arc->push_m_s2, 3U) && cfi_finite(arc->push_rate_m_s3, 3U);
    good = good && cfi_finite(arc->push_bend_m_s4, 3U) && cfi_finite(arc->push_twist_m_s5, 3U);
    good = good && ((duration >= CFF_SHORTEST_S) || (arc->end_s == arc->start_s)); /* a last impulse has no duration */
    if (good && (path->chief != NULL)) {
        good = !any(arc->push_rate_m_s3) && !push_bends(arc) && cfi_within_table(path->chief, arc->start_s, arc->end_s);
    } else if (good) {
        const double n = arc->mean_motion_rad_s;
        good = cfi_finite(&n, 1U) && (n >= 0.0) && (n == path->arcs[0].mean_motion_rad_s) &&
               ((n * duration) <= CFF_LARGEST_ANGLE_RAD);
    } else {
        /* bad */
    }
    return good && ((k == 0U) || joins(path, k));
}

cff_status_t cff_check_path(const cff_path_t *path)
{
    bool good = (path->count > 0U) && (path->count <= CFF_MOST_ARCS);
    if (good && (path->chief != NULL)) {
        good = cfi_clock_is_good(path->chief);
    }
    for (uint32_t k = 0U; good && (k < path->count); k++) {
        good = arc_is_good(path, k);
    }
    return good ? CFF_OK : CFF_BAD_INPUT;
}

/* A time in a path, or the nearest. */
static double within(const cff_path_t *path, double t)
{
    return cfi_min(cfi_max(t, path->arcs[0].start_s), path->arcs[path->count - 1U].end_s);
}

cff_status_t cff_state_at(const cff_path_t *path, double time_s, cff_state_t *state)
{
    cff_status_t status = cfi_finite(&time_s, 1U) ? cff_check_path(path) : CFF_BAD_INPUT;
    if (status == CFF_OK) {
        cff_state_t unused;
        const double t = within(path, time_s);
        cfi_arc_motion(path, cfi_locate(path, t), t, state, &unused);
    }
    return status;
}

cff_status_t cff_thrust_at(const cff_path_t *path, double time_s, double thrust_m_s2[3])
{
    cff_status_t status = cfi_finite(&time_s, 1U) ? cff_check_path(path) : CFF_BAD_INPUT;
    if (status == CFF_OK) {
        cff_state_t m;
        cff_state_t u;
        double f[4][3];
        const double t = within(path, time_s);
        const uint32_t k = cfi_locate(path, t);
        cfi_arc_motion(path, k, t, &m, &u);
        push(&path->arcs[k], t, f);
        for (uint32_t i = 0U; i < 3U; i++) {
            thrust_m_s2[i] = u.position_m[i] + ((path->chief != NULL) ? path->arcs[k].push_m_s2[i] : f[0][i]);
        }
    }
    return status;
}
