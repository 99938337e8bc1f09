/*
 * Polynomials of degree 11 in Bernstein form on [0, 1] (closeform/motion/chief/bernstein.py).
 *
 * A polynomial lies in the hull of its coefficients, and has at most as many roots as they change signs, and
 * one if they change once.  Cutting it by de Casteljau's algorithm takes means of coefficients only.
 */
#include <math.h>

#include "cff_internal.h"

#define DEGREE (CFF_TERMS - 1U)

static const double CHOOSE_11[CFF_TERMS] = {1.0, 11.0, 55.0, 165.0, 330.0, 462.0, 462.0, 330.0, 165.0, 55.0, 11.0, 1.0};
static const double CHOOSE_10[CFF_TERMS - 1U] = {1.0, 10.0, 45.0, 120.0, 210.0, 252.0, 210.0, 120.0, 45.0, 10.0, 1.0};
static const double CHOOSE_22[CFF_SQUARE] = {
    1.0,      22.0,     231.0,    1540.0,   7315.0,   26334.0,  74613.0, 170544.0, 319770.0, 497420.0, 646646.0, 705432.0,
    646646.0, 497420.0, 319770.0, 170544.0, 74613.0,  26334.0,  7315.0,  1540.0,   231.0,    22.0,     1.0,
};

/* The polynomials of degree 11 that come nearest to u^12 ... u^18 on [0, 1], in powers of u, and how far off. */
#define HIGHER (CFF_POWERS - CFF_TERMS)
static const double NEAREST[HIGHER][CFF_TERMS] = {
    {-1.1920928955078125e-07, 3.4332275390625e-05, -0.001636505126953125, 0.030548095703125, -0.2945709228515625,
     1.67578125, -6.04296875, 14.34375, -22.7109375, 23.75, -15.75, 6.0},
    {-7.450580596923828e-07, 0.00021308660507202148, -0.010073184967041016, 0.18615245819091797, -1.7728805541992188,
     9.928131103515625, -35.07080078125, 80.9326171875, -123.017578125, 120.60546875, -71.09375, 20.3125},
    {-2.6151537895202637e-06, 0.0007435083389282227, -0.03490358591079712, 0.6396875381469727, -6.031339645385742,
     33.3585205078125, -115.99667358398438, 262.2216796875, -387.50537109375, 364.7109375, -201.55078125, 51.1875},
    {-6.806105375289917e-06, 0.001925155520439148, -0.0898405909538269, 1.6350987553596497, -15.28923511505127,
     83.71705627441406, -287.51312255859375, 639.7956848144531, -926.180419921875, 847.4853515625, -449.61328125,
     107.05078125},
    {-1.4652032405138016e-05, 0.004126012325286865, -0.19156485795974731, 3.465850353240967, -32.18289613723755,
     174.76287841796875, -594.1937866210938, 1305.92041015625, -1860.9365844726562, 1668.06640625, -860.37109375,
     196.65625},
    {-2.76295468211174e-05, 0.007750087883323431, -0.3582262843847275, 6.448073118925095, -59.52067494392395,
     320.9707508087158, -1082.2815399169922, 2354.8543395996094, -3314.2394409179688, 2924.3289184570312,
     -1477.5556640625, 328.345703125},
    {-4.724017344415188e-05, 0.013205017894506454, -0.6079810322262347, 10.895020097494125, -100.05630701780319,
     536.3702201843262, -1796.0275554656982, 3875.543975830078, -5399.924606323242, 4705.816650390625,
     -2340.5245971679688, 509.501953125},
};
static const double FARTHEST[HIGHER] = {1.2e-7, 8.1e-7, 3.1e-6, 8.5e-6, 2.0e-5, 3.9e-5, 7.0e-5};
#define BEYOND 0.03 /* terms beyond u^18 for angles up to 1.5, relative to the last four terms */

/*
 * Add power k of a series whose terms fall as those of relative motion over an angle of at most 1.5 do; a bound of the
 * error is added to `off`.
 */
void cfi_add_power(uint32_t k, double power, double f[CFF_TERMS], double *off)
{
    if (k < CFF_TERMS) {
        f[k] += power;
    } else {
        const uint32_t m = k - CFF_TERMS;
        for (uint32_t b = 0U; b < CFF_TERMS; b++) {
            f[b] += NEAREST[m][b] * power;
        }
        *off += (FARTHEST[m] + ((m >= (HIGHER - 4U)) ? BEYOND : 0.0)) * fabs(power);
    }
}

/* Replace coefficients of powers by those of Bernstein polynomials: sums of binomial shares, b_i = sum C(i, k) f_k. */
void cfi_end_powers(double f[CFF_TERMS])
{
    for (uint32_t k = 0U; k < CFF_TERMS; k++) {
        f[k] /= CHOOSE_11[k];
    }
    for (uint32_t turn = 0U; turn < DEGREE; turn++) {
        for (uint32_t k = DEGREE; k > turn; k--) {
            f[k] += f[k - 1U];
        }
    }
}

/* The coefficients over [low, high]. */
void cfi_cut(const double f[CFF_TERMS], double low, double high, double out[CFF_TERMS])
{
    for (uint32_t k = 0U; k < CFF_TERMS; k++) {
        out[k] = f[k];
    }
    if (high < 1.0) { /* of each round of means the last is kept: the part below */
        for (uint32_t turn = 0U; turn < DEGREE; turn++) {
            for (uint32_t k = DEGREE; k > turn; k--) {
                out[k] = out[k - 1U] + (high * (out[k] - out[k - 1U]));
            }
        }
    }
    if (low > 0.0) { /* and here the first: the part above */
        const double u = (low < high) ? (low / high) : 1.0;
        for (uint32_t turn = 0U; turn < DEGREE; turn++) {
            for (uint32_t k = 0U; k < (DEGREE - turn); k++) {
                out[k] += u * (out[k + 1U] - out[k]);
            }
        }
    }
}

/* The Bernstein polynomials at u. */
void cfi_weights(double u, double weights[CFF_TERMS])
{
    double power = 1.0;
    for (uint32_t k = 0U; k < CFF_TERMS; k++) {
        weights[k] = CHOOSE_11[k] * power;
        power *= u;
    }
    power = 1.0;
    for (uint32_t k = CFF_TERMS; k > 0U; k--) {
        weights[k - 1U] *= power;
        power *= 1.0 - u;
    }
}

/* The value and the slope at u. */
double cfi_value(const double f[CFF_TERMS], double u, double *slope)
{
    const double v = 1.0 - u;
    double power = 1.0;
    double total = f[0];
    double rate = f[1] - f[0];
    for (uint32_t k = 1U; k < CFF_TERMS; k++) {
        power *= u;
        total = (total * v) + (CHOOSE_11[k] * power * f[k]);
        if (k < DEGREE) {
            rate = (rate * v) + (CHOOSE_10[k] * power * (f[k + 1U] - f[k]));
        }
    }
    *slope = 11.0 * rate; /* of degree 11 */
    return total;
}

/* The coefficients of the sum of the squares of the first axes. */
void cfi_square(const double c[3][CFF_TERMS], uint32_t axes, double f[CFF_SQUARE])
{
    for (uint32_t k = 0U; k < CFF_SQUARE; k++) {
        f[k] = 0.0;
    }
    for (uint32_t axis = 0U; axis < axes; axis++) {
        double share[CFF_TERMS];
        for (uint32_t k = 0U; k < CFF_TERMS; k++) {
            share[k] = CHOOSE_11[k] * c[axis][k];
        }
        for (uint32_t i = 0U; i < CFF_TERMS; i++) {
            const double twice = 2.0 * share[i];
            f[2U * i] += share[i] * share[i];
            for (uint32_t j = i + 1U; j < CFF_TERMS; j++) {
                f[i + j] += twice * share[j];
            }
        }
    }
    for (uint32_t k = 0U; k < CFF_SQUARE; k++) {
        f[k] /= CHOOSE_22[k];
    }
}
