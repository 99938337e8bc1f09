/*
 * Hill's equations in closed form, for any mean motion n >= 0 (closeform/motion/hill.py).
 *
 * With N = diag(3n^2, 0, -n^2) and S v = (2n vy, -2n vx, 0): r'' = N r + S r' + u.  All is built from
 * P_m = 1/(s^m (s^2 + n^2)) and Q_m = 1/(s^m (s^2 + n^2)^2), which are smooth at n = 0 and enter with
 * non-negative powers of n only: no digit is lost as n t -> 0, and n = 0 is no special case.
 */
#include <math.h>

#include "cff_internal.h"

/* Coefficients in (n t)^2 over the leading power of t, last term first; up to n t = 1 and up to n t = 2. */
#define NEAR_TERMS 9U
#define TERMS 13U
#define SERIES_BELOW 2.0

static const double P1_NEAR[NEAR_TERMS] = {
    1.5619206968586225e-16, -4.779477332387385e-14, 1.1470745597729725e-11, -2.08767569878681e-09, 2.755731922398589e-07,
    -2.48015873015873e-05,  0.001388888888888889,   -0.041666666666666664,  0.5,
};
static const double P2_NEAR[NEAR_TERMS] = {
    8.22063524662433e-18,   -2.8114572543455206e-15, 7.647163731819816e-13, -1.6059043836821613e-10, 2.505210838544172e-08,
    -2.7557319223985893e-06, 0.0001984126984126984,  -0.008333333333333333, 0.16666666666666666,
};
static const double P3[TERMS] = {
    3.279889237069838e-30,  -2.4795962632247972e-27, 1.6117375710961184e-24,  -8.896791392450574e-22, 4.110317623312165e-19,
    -1.5619206968586225e-16, 4.779477332387385e-14,  -1.1470745597729725e-11, 2.08767569878681e-09,   -2.755731922398589e-07,
    2.48015873015873e-05,   -0.001388888888888889,   0.041666666666666664,
};
static const double P4[TERMS] = {
    1.1309962886447718e-31, -9.183689863795546e-29, 6.446950284384474e-26,  -3.8681701706306835e-23, 1.9572941063391263e-20,
    -8.22063524662433e-18,  2.8114572543455206e-15, -7.647163731819816e-13, 1.6059043836821613e-10,  -2.505210838544172e-08,
    2.7557319223985893e-06, -0.0001984126984126984, 0.008333333333333333,
};
static const double Q3[TERMS] = {
    4.900983917460677e-32,  -3.9358670844838056e-29, 2.727555889547277e-26,  -1.6117375710961184e-23, 8.007112253205516e-21,
    -3.288254098649732e-18, 1.093344487801036e-15,   -2.867686399432431e-13, 5.735372798864862e-11,   -8.35070279514724e-09,
    8.267195767195768e-07,  -4.96031746031746e-05,   0.001388888888888889,
};
static const double Q4[TERMS] = {
    1.5809625540195733e-33, -1.357195546373726e-30,  1.01020588501751e-27,    -6.446950284384473e-25, 3.4813531535676156e-22,
    -1.565835285071301e-19, 5.75444467263703e-17,    -1.6868743526073125e-14, 3.823581865909908e-12,  -6.423617534728645e-10,
    7.515632515632516e-08,  -5.5114638447971785e-06, 0.0001984126984126984,
};

/* Sine and cosine to 2e-16 by their series about the next quarter turn (closeform/search/sine_cosine.py). */
#define QUARTER 1.57079632673412561417 /* of a turn, to 33 bits */
#define REST 6.07710050650619224932e-11
#define TWO_OVER_PI 0.6366197723675814

static double horner(const double series[], uint32_t count, double z)
{
    double total = 0.0;
    for (uint32_t k = 0U; k < count; k++) {
        total = (total * z) + series[k];
    }
    return total;
}

/* The greatest whole number up to x, for |x| < 2e9; beyond, 0. */
double cfi_whole(double x)
{
    double cut = 0.0;
    if ((x > -2.0e9) && (x < 2.0e9)) {
        cut = (double)(int32_t)x;
    }
    return (cut > x) ? (cut - 1.0) : cut;
}

void cfi_sine_cosine(double angle, double *sine, double *cosine)
{
    const double turns = cfi_whole((angle * TWO_OVER_PI) + 0.5);
    const double x = (angle - (turns * QUARTER)) - (turns * REST);
    const double z = x * x;
    const double zz = z * z;
    double s = ((1.0 + (-0.16666666666666666 * z)) + ((0.008333333333333333 + (-0.0001984126984126984 * z)) * zz)) +
               (((2.7557319223985893e-06 + (-2.505210838544172e-08 * z)) +
                 ((1.6059043836821613e-10 + (-7.647163731819816e-13 * z)) * zz)) *
                (zz * zz));
    double c = (((2.48015873015873e-05 + (-2.755731922398589e-07 * z)) +
                 ((2.08767569878681e-09 + (-1.1470745597729725e-11 * z)) * zz)) +
                (4.779477332387385e-14 * (zz * zz))) *
               (zz * zz);
    c += (1.0 + (-0.5 * z)) + ((0.041666666666666664 + (-0.001388888888888889 * z)) * zz);
    s *= x;
    const double half = cfi_whole(turns * 0.5);
    const double odd = turns - (2.0 * half);
    const double sign = 1.0 - (2.0 * (half - (2.0 * cfi_whole(half * 0.5))));
    *sine = sign * ((s * (1.0 - odd)) + (c * odd));
    *cosine = sign * ((c * (1.0 - odd)) - (s * odd));
}

static void sine_cosine(double angle, double *sine, double *cosine)
{
#ifdef CFF_LIBM_TRIGONOMETRY
    *sine = sin(angle);
    *cosine = cos(angle);
#else
    cfi_sine_cosine(angle, sine, cosine);
#endif
}

/* sin(nt)/n, (1 - cos nt)/n^2 and (nt - sin nt)/n^3: P_0, P_1, P_2. */
void cfi_oscillation(double n, double t, double p[3])
{
    const double angle = n * t;
    if (fabs(angle) < 1.0) {
        const double p2 = t * t * t * horner(P2_NEAR, NEAR_TERMS, angle * angle);
        p[0] = t - (n * n * p2);
        p[1] = t * t * horner(P1_NEAR, NEAR_TERMS, angle * angle);
        p[2] = p2;
    } else {
        double s;
        double c;
        sine_cosine(angle, &s, &c);
        p[0] = s / n;
        p[1] = (1.0 - c) / (n * n);
        p[2] = (angle - s) / (n * n * n);
    }
}

void cfi_transforms(double n, double t, cfi_transforms_t *out)
{
    const double nn = n * n;
    const double z = nn * t * t;
    const double tt = t * t;
    if (z < (SERIES_BELOW * SERIES_BELOW)) { /* downward recurrences, stable for small nt */
        out->p3 = tt * tt * horner(P3, TERMS, z);
        out->p4 = tt * tt * t * horner(P4, TERMS, z);
        out->q3 = tt * tt * tt * horner(Q3, TERMS, z);
        out->q4 = tt * tt * tt * t * horner(Q4, TERMS, z);
        out->p1 = (0.5 * tt) - (nn * out->p3);
        out->p2 = (tt * t / 6.0) - (nn * out->p4);
        out->p0 = t - (nn * out->p2);
        out->q2 = out->p4 - (nn * out->q4);
        out->q1 = out->p3 - (nn * out->q3);
        out->q0 = out->p2 - (nn * out->q2);
        out->qm1 = out->p1 - (nn * out->q1);
        out->qm2 = out->p0 - (nn * out->q0);
    } else { /* upward, stable for large nt */
        double s;
        double c;
        sine_cosine(n * t, &s, &c);
        out->p0 = s / n;
        out->p1 = (1.0 - c) / nn;
        out->p2 = (t - out->p0) / nn;
        out->p3 = ((0.5 * tt) - out->p1) / nn;
        out->p4 = ((tt * t / 6.0) - out->p2) / nn;
        out->qm2 = 0.5 * (out->p0 + (t * c));
        out->qm1 = 0.5 * t * out->p0;
        out->q0 = (out->p0 - out->qm2) / nn;
        out->q1 = (out->p1 - out->qm1) / nn;
        out->q2 = (out->p2 - out->q0) / nn;
        out->q3 = (out->p3 - out->q1) / nn;
        out->q4 = (out->p4 - out->q2) / nn;
    }
}

/* Natural motion after time t, by the oscillation p of t. */
void cfi_coast(double n, double t, const double p[3], const double r[3], const double v[3], cff_state_t *out)
{
    const double c = 1.0 - (n * n * p[1]);
    const double ax = n * ((3.0 * n * r[0]) + (2.0 * v[1]));
    const double moved = (v[0] * p[1]) + (ax * p[2]); /* the integral of x - x(0) */
    const double x = r[0];
    const double y = r[1];
    const double z = r[2];
    const double vx = v[0];
    const double vy = v[1];
    const double vz = v[2];
    out->position_m[0] = x + (vx * p[0]) + (ax * p[1]);
    out->position_m[1] = y + (vy * t) - (2.0 * n * moved);
    out->position_m[2] = (z * c) + (vz * p[0]);
    out->velocity_m_s[0] = (vx * c) + (ax * p[0]);
    out->velocity_m_s[1] = vy - (2.0 * n * ((vx * p[0]) + (ax * p[1])));
    out->velocity_m_s[2] = (vz * c) - (n * n * z * p[0]);
}

/* Add the state reached from rest at the origin under optimal thrust that starts at u with rate w. */
void cfi_add_driven(double n, double t, const cfi_transforms_t *k, const double u[3], const double w[3],
                     cff_state_t *out)
{
    const double m = 2.0 * n;
    const double a = n * ((3.0 * n * u[0]) + (2.0 * w[1]));
    const double x = (u[0] * k->p1) + (w[0] * k->q0) + (a * k->q1) +
                     (m * ((u[1] * k->p2) + (w[1] * k->p3) - (m * ((w[0] * k->q2) + (a * k->q3)))));
    const double vx = (u[0] * k->p0) + (w[0] * k->qm1) + (a * k->q0) +
                      (m * ((u[1] * k->p1) + (w[1] * k->p2) - (m * ((w[0] * k->q1) + (a * k->q2)))));
    const double moved = (u[0] * k->p2) + (w[0] * k->q1) + (a * k->q2) +
                         (m * ((u[1] * k->p3) + (w[1] * k->p4) - (m * ((w[0] * k->q3) + (a * k->q4)))));
    out->position_m[0] += x;
    out->position_m[1] +=
        (-m * moved) + (u[1] * t * t / 2.0) + (w[1] * t * t * t / 6.0) - (m * ((w[0] * k->p3) + (a * k->p4)));
    out->position_m[2] += (u[2] * k->qm1) + (w[2] * k->q0);
    out->velocity_m_s[0] += vx;
    out->velocity_m_s[1] += (-m * x) + (u[1] * t) + (w[1] * t * t / 2.0) - (m * ((w[0] * k->p2) + (a * k->p3)));
    out->velocity_m_s[2] += (u[2] * k->qm2) + (w[2] * k->qm1);
}

/* Add the state reached from rest at the origin under the arc's push. */
void cfi_add_pushed(double n, double t, const cfi_transforms_t *k, const cff_arc_t *arc, cff_state_t *out)
{
    const double *a = arc->push_m_s2;
    const double *b = arc->push_rate_m_s3;
    const double *c = arc->push_bend_m_s4;
    const double *d = arc->push_twist_m_s5;
    const double m = 2.0 * n;
    const double y1 = (a[1] * t) + (b[1] * t * t / 2.0) + (c[1] * k->p2) + (d[1] * k->p3);
    const double y2 = (a[1] * t * t / 2.0) + (b[1] * t * t * t / 6.0) + (c[1] * k->p3) + (d[1] * k->p4);
    const double across = (a[1] * k->p2) + (b[1] * k->p3) + (c[1] * k->q2) + (d[1] * k->q3);
    const double x = (a[0] * k->p1) + (b[0] * k->p2) + (c[0] * k->q1) + (d[0] * k->q2) + (m * across);
    const double far = (a[1] * k->p3) + (b[1] * k->p4) + (c[1] * k->q3) + (d[1] * k->q4);
    const double moved = (a[0] * k->p2) + (b[0] * k->p3) + (c[0] * k->q2) + (d[0] * k->q3) + (m * far);
    const double gained = (a[1] * k->p1) + (b[1] * k->p2) + (c[1] * k->q1) + (d[1] * k->q2);
    out->position_m[0] += x;
    out->position_m[1] += y2 - (m * moved);
    out->position_m[2] += (a[2] * k->p1) + (b[2] * k->p2) + (c[2] * k->q1) + (d[2] * k->q2);
    out->velocity_m_s[0] += (a[0] * k->p0) + (b[0] * k->p1) + (c[0] * k->q0) + (d[0] * k->q1) + (m * gained);
    out->velocity_m_s[1] += y1 - (m * x);
    out->velocity_m_s[2] += (a[2] * k->p0) + (b[2] * k->p1) + (c[2] * k->q0) + (d[2] * k->q1);
}

/* The next coefficient but one of the power series of a motion over an angle, under a force. */
static void follow(double angle, double k, const double now[3], const double next[3], const double force[3],
                   double after[3])
{
    const double turn = 2.0 * angle * (k + 1.0);
    const double kk = (k + 1.0) * (k + 2.0);
    after[0] = ((3.0 * angle * angle * now[0]) + (turn * next[1]) + force[0]) / kk;
    after[1] = (force[1] - (turn * next[0])) / kk;
    after[2] = (force[2] - (angle * angle * now[2])) / kk;
}

/* Go on from power k to the next of the series of a motion over an angle. */
void cfi_step(double angle, uint32_t k, cfi_start_t *s)
{
    static const double nothing[3] = {0.0, 0.0, 0.0};
    const double kk = ((double)k + 3.0) * ((double)k + 4.0);
    double force[3];
    double later[3];
    double thrust[3];
    for (uint32_t i = 0U; i < 3U; i++) {
        force[i] = s->u[i] + s->push[0][i];
    }
    follow(angle, (double)k, s->r, s->v, force, later);
    follow(angle, (double)k, s->u, s->w, nothing, thrust);
    for (uint32_t i = 0U; i < 3U; i++) {
        s->r[i] = s->v[i];
        s->v[i] = later[i];
        s->u[i] = s->w[i];
        s->w[i] = thrust[i];
        const double turned = -angle * angle * s->push[2][i] / kk; /* beyond its rate a push turns with the orbit */
        s->push[0][i] = s->push[1][i];
        s->push[1][i] = s->push[2][i];
        s->push[2][i] = s->push[3][i];
        s->push[3][i] = turned;
    }
}
