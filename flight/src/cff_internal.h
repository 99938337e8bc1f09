/* Declarations that the files of closeform_flight share; not for callers. */
#ifndef CFF_INTERNAL_H
#define CFF_INTERNAL_H

#include <stddef.h>

#include "closeform_flight.h"

#define CFF_PI 3.14159265358979323846
#define CFF_FOREVER 1.0e300          /* a time that no end is beyond */
#define CFF_REACH 0.7853981633974483 /* rad of a power series: eight an orbit; with six, errors reach 1e-10 of far positions */
#define CFF_ROUNDING 4.0e-15         /* of a coefficient, relative to the largest */
#define CFF_ON_JOINT 1.0e-14         /* rad: angles of a table that differ by no more are one joint */
#define CFF_POWERS ((uint32_t)19U)   /* coefficients of a power series of a view */
#define CFF_SQUARE ((uint32_t)23U)   /* coefficients of the square of a polynomial */

/* P_0 ... P_4 and Q_-2 ... Q_4 (theory 1): inverse Laplace transforms, smooth at n = 0. */
typedef struct {
    double p0;
    double p1;
    double p2;
    double p3;
    double p4;
    double qm2;
    double qm1;
    double q0;
    double q1;
    double q2;
    double q3;
    double q4;
} cfi_transforms_t;

/*
 * A power of the series of a motion in time: the coefficients of position, optimal thrust and push, and of the next powers.
 * The first powers fix the motion, in units of a time.
 */
typedef struct {
    double r[3];
    double v[3];
    double u[3];
    double w[3];
    double push[4][3];
} cfi_start_t;

/*
 * A view: the relative position of two arcs for some time, in zone units, as Bernstein polynomials of u in
 * [0, 1].  Time is linear in u, or by the clock of a table the angle is.
 */
typedef struct {
    double c[3][CFF_TERMS];
    double off[3]; /* bound of the error along each axis */
    double first;  /* time or angle at u = 0 */
    double length; /* and from there to u = 1 */
    double from_s;
    double until_s;
    const cff_table_t *chief;
} cfi_view_t;

/* The part of a view over [low, low + width]. */
typedef struct {
    double c[3][CFF_TERMS];
    double off[3];
    double low;
    double width;
} cfi_piece_t;

static inline double cfi_min(double a, double b) { return (b < a) ? b : a; }
static inline double cfi_max(double a, double b) { return (b > a) ? b : a; }
static inline uint32_t cfi_larger(uint32_t a, uint32_t b) { return (b > a) ? b : a; }
static inline double cfi_dot(const double a[3], const double b[3])
{
    return ((a[0] * b[0]) + (a[1] * b[1])) + (a[2] * b[2]);
}

/* Subtract a cost from a budget; 0 is left if the budget is smaller. */
static inline void cfi_spend(uint32_t *evaluations, uint32_t cost)
{
    *evaluations = (*evaluations > cost) ? (*evaluations - cost) : 0U;
}

/* cff_hill.c */
double cfi_whole(double x);
void cfi_sine_cosine(double angle, double *sine, double *cosine);
void cfi_oscillation(double n, double t, double p[3]);
void cfi_transforms(double n, double t, cfi_transforms_t *out);
void cfi_coast(double n, double t, const double p[3], const double r[3], const double v[3], cff_state_t *out);
void cfi_add_driven(double n, double t, const cfi_transforms_t *k, const double u[3], const double w[3],
                     cff_state_t *out);
void cfi_add_pushed(double n, double t, const cfi_transforms_t *k, const cff_arc_t *arc, cff_state_t *out);
void cfi_step(double angle, uint32_t k, cfi_start_t *s);

/* cff_arc.c */
bool cfi_finite(const double numbers[], uint32_t count);
bool cfi_state_finite(const cff_state_t *state);
bool cfi_thrusts(const cff_arc_t *arc);
bool cfi_pushes(const cff_arc_t *arc);
void cfi_state(const cff_arc_t *arc, double t, cff_state_t *out);
void cfi_add_start(const cff_arc_t *arc, double t, double h, double sign, cfi_start_t *out);
uint32_t cfi_locate(const cff_path_t *path, double t);

void cfi_arc_motion(const cff_path_t *path, uint32_t k, double t, cff_state_t *state, cff_state_t *primer);
void cfi_primer(const cff_arc_t *arc, double t, cff_state_t *out);
void cfi_miss(const cff_state_t *wanted, const cff_state_t *reached, double gap[6]);

/* cff_transfer.c */
bool cfi_solve(double matrix[], uint32_t size, double rhs[], double columns[]);
bool cfi_steer(const cff_table_t *chief, double n, double from, double to, const double gap[6], double thrust[6]);

/* cff_table.c */
double cfi_angle(const cff_table_t *chief, double t);
double cfi_time(const cff_table_t *chief, double angle);
bool cfi_clock_is_good(const cff_table_t *chief);
bool cfi_within_table(const cff_table_t *chief, double from, double to);
void cfi_place(const cff_table_t *chief, const cff_arc_t *arc, double t, cff_cursor_t *place);
void cfi_next_window(const cff_table_t *chief, cff_cursor_t *place);
void cfi_go_back(const cff_table_t *chief, cff_cursor_t *place, double u);
double cfi_share(const cff_table_t *chief, const cff_cursor_t *place, double angle);
void cfi_go_on(const cff_table_t *chief, cff_cursor_t *place, double t);
double cfi_window_end(const cff_table_t *chief, const cff_cursor_t *place);
const double *cfi_row(const cff_table_t *chief, uint32_t k, uint32_t j, uint32_t i);
void cfi_see_window(const cff_table_t *chief, uint32_t window, const double columns[CFF_COLUMNS], const cff_zone_t *zone,
                    cfi_view_t *view);
void cfi_columns_at(const cff_table_t *chief, const cff_cursor_t *place, double t, double columns[CFF_COLUMNS]);
void cfi_arc_state(const cff_table_t *chief, const cff_arc_t *arc, double t, cff_state_t *state, cff_state_t *primer);

/* cff_polynomial.c */
void cfi_cut(const double f[CFF_TERMS], double low, double high, double out[CFF_TERMS]);
void cfi_weights(double u, double weights[CFF_TERMS]);
double cfi_value(const double f[CFF_TERMS], double u, double *slope);
void cfi_square(const double c[3][CFF_TERMS], uint32_t axes, double f[CFF_SQUARE]);
void cfi_add_power(uint32_t k, double power, double f[CFF_TERMS], double *off);
void cfi_end_powers(double f[CFF_TERMS]);

/* cff_zone.c */
double cfi_norm(cff_shape_t shape, const double r[3]);
uint32_t cfi_round_axes(cff_shape_t shape, uint32_t part);
void cfi_hull(const double f[CFF_TERMS], double *least, double *most);
uint32_t cfi_part_count(cff_shape_t shape);
uint32_t cfi_level(cff_shape_t shape, uint32_t part, const cfi_piece_t *piece, double f[CFF_SQUARE]);
double cfi_height(cff_shape_t shape, uint32_t part, const cfi_piece_t *piece, double u, double *rate);
bool cfi_excluded(cff_shape_t shape, const cfi_piece_t pieces[], uint32_t count);
double cfi_lower_bound(cff_shape_t shape, const cfi_piece_t *piece, double f[CFF_SQUARE]);

/* cff_view.c */
/* Cost of a view in evaluations of at most 800 instructions on LEON3: by Hill's equations and beside a table. */
static inline uint32_t cfi_view_cost(const cff_path_t *path) { return (path->chief != NULL) ? 32U : 12U; }
/* And of a state. */
static inline uint32_t cfi_motion_cost(const cff_table_t *chief) { return (chief != NULL) ? 20U : 1U; }
#define CFF_PIECE_EVALUATIONS 8U /* and of a piece */
#define CFF_FINEST 1073741824.0  /* parts of a view: 2^30; a narrower piece is an instant */
void cfi_see(const cff_path_t *one, cff_cursor_t *at_one, const cff_path_t *other, cff_cursor_t *at_other, double t,
             double end, const cff_zone_t *zone, cfi_view_t *view);
void cfi_see_coast(const cff_path_t *coast, cff_cursor_t *place, double t, double end, cfi_view_t *view);
void cfi_follow(const cff_path_t *path, cff_cursor_t *place, double t);
void cfi_begin_place(const cff_path_t *path, cff_cursor_t *place, double t);
double cfi_pace(const cfi_view_t *view, double u);
double cfi_time_in(const cfi_view_t *view, double u);
void cfi_take_piece(const cfi_view_t *view, cfi_piece_t *piece);
bool cfi_next_interval(double *low, double *width);
bool cfi_halve_piece(cfi_piece_t *piece);

/* cff_conflicts.c */
cff_status_t cfi_check_pair(const cff_path_t *one, const cff_path_t *other, const cff_zone_t *zone);

/* cff_inside.c */
bool cfi_close_conflict(cff_conflict_search_t *search, cff_conflict_t conflicts[], uint32_t capacity, uint32_t *count);
bool cfi_search_view(cff_conflict_search_t *search, const cfi_view_t *view, cff_conflict_t conflicts[], uint32_t capacity,
                     uint32_t *count, uint32_t *evaluations);

/* cff_search.c */
void cfi_cross(const double a[3], const double b[3], double out[3]);
bool cfi_leg_is_good(const cff_leg_t *leg);

/* cff_extremum.c */
double cfi_minimum(const cfi_view_t *view, cff_shape_t shape, double *best, double *best_u, uint32_t *evaluations);

#endif
