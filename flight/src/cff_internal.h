/* What the files of closeform_flight share; not for callers. */
#ifndef CFF_INTERNAL_H
#define CFF_INTERNAL_H

#include "closeform_flight.h"

#define CFF_PI 3.14159265358979323846
#define CFF_FOREVER 1.0e300 /* a time that no end is beyond */
#define CFF_ORDER ((uint32_t)8U)       /* derivatives of a relative position that a view holds at most */
#define CFF_COAST_ORDER ((uint32_t)4U) /* those of natural motion */

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

typedef struct {
    double r[3];
    double v[3];
} cfi_motion_t;

/* Two arcs seen at once from one instant on: derivatives of the relative position, in zone units. */
typedef struct {
    double q[CFF_ORDER][3];
    uint32_t order;
    double n;
} cfi_view_t;

/* Bounds over a view: of the acceleration along each axis, and of its norm and the speed's. */
typedef struct {
    double axis[3];
    double acceleration;
    double speed;
} cfi_bounds_t;

static inline double cfi_min(double a, double b) { return (b < a) ? b : a; }
static inline double cfi_max(double a, double b) { return (b > a) ? b : a; }
static inline double cfi_dot(const double a[3], const double b[3])
{
    return ((a[0] * b[0]) + (a[1] * b[1])) + (a[2] * b[2]);
}

/* Take some evaluations; those that are there, if fewer are. */
static inline void cfi_spend(uint32_t *evaluations, uint32_t cost) { *evaluations = (*evaluations > cost) ? (*evaluations - cost) : 0U; }

/* cff_hill.c */
void cfi_sine_cosine(double angle, double *sine, double *cosine);
void cfi_oscillation(double n, double t, double p[3]);
void cfi_transforms(double n, double t, cfi_transforms_t *out);
void cfi_coast(double n, double t, const double p[3], const double r[3], const double v[3], cfi_motion_t *out);
void cfi_add_driven(double n, double t, const cfi_transforms_t *k, const double u[3], const double w[3],
                     cfi_motion_t *out);
void cfi_add_pushed(double n, double t, const cfi_transforms_t *k, const cff_arc_t *arc, cfi_motion_t *out);
void cfi_accelerate(double n, const double r[3], const double v[3], double a[3]);

/* cff_arc.c */
bool cfi_finite(const double numbers[], uint32_t count);
bool cfi_state_finite(const cff_state_t *state);
bool cfi_thrusts(const cff_arc_t *arc);
bool cfi_is_cubic(const cff_arc_t *arc);
void cfi_state(const cff_arc_t *arc, double t, cfi_motion_t *out);
void cfi_add_derivatives(const cff_arc_t *arc, double t, uint32_t order, double sign, double out[CFF_ORDER][3]);
uint32_t cfi_locate(const cff_path_t *path, double t);

/* cff_transfer.c */
bool cfi_steer(double n, double t, const double gap[6], double thrust[6]);

/* cff_zone.c */
double cfi_norm(cff_shape_t shape, const double r[3]);
double cfi_rate(cff_shape_t shape, const cfi_motion_t *m);
double cfi_outside_step(cff_shape_t shape, const cfi_motion_t *m, const cfi_bounds_t *b, double target);
double cfi_inside_step(cff_shape_t shape, const cfi_motion_t *m, const cfi_bounds_t *b, double target);

/* cff_view.c */
#define CFF_PATIENCE 60U     /* steps in one view before the Taylor model is tried */
#define CFF_LESS_PATIENCE 3U /* and once it has been needed */
#define CFF_VIEW_EVALUATIONS 12U   /* what a view costs, in evaluations: measured on LEON3 and Cortex-M7 */
#define CFF_TAYLOR_EVALUATIONS 28U /* what a Taylor model costs at worst */
double cfi_view_end(const cff_arc_t *a, const cff_arc_t *b, double t, double end);
void cfi_see(const cff_arc_t *a, const cff_arc_t *b, double t, const cff_zone_t *zone, cfi_view_t *view);
void cfi_evaluate(const cfi_view_t *view, double t, cfi_motion_t *out);
void cfi_bounds(const cfi_view_t *view, double h, cfi_bounds_t *out);
double cfi_taylor_step(const cfi_view_t *view, double longest, double target, bool inside);
bool cfi_coasts_apart(const cfi_view_t *view, cff_shape_t shape, double h);

/* cff_search.c */
void cfi_cross(const double a[3], const double b[3], double out[3]);
bool cfi_leg_is_good(const cff_leg_t *leg);

/* cff_extremum.c */
double cfi_minimum(const cfi_view_t *view, cff_shape_t shape, double stop, uint32_t patience, double *best,
                    double *best_time, uint32_t *evaluations);

#endif
