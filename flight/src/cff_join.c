/*
 * Gathering of lost craft: the sets, and the effect of a lock on them (closeform/search/gathering/join_rule.py;
 * Hadaegh et al. 2003, section IV).
 */
#include "cff_internal.h"

/* Row or column of the paper's table: lost, knowledge set, formation set. */
static uint32_t place_in_table(int32_t label)
{
    uint32_t place = 1U;
    if (label == CFF_LOST) {
        place = 0U;
    } else if (label == CFF_FORMATION) {
        place = 2U;
    } else {
        /* a knowledge set */
    }
    return place;
}

/* The label of the set that a lock between craft of these labels makes. */
static int32_t joint_label(const cff_gathering_t *gathering, int32_t one, int32_t other)
{
    int32_t label = (one < other) ? one : other; /* into the formation set, or the older knowledge set */
    if ((one == CFF_LOST) && (other == CFF_LOST)) {
        label = (gathering->formed == 0U) ? CFF_FORMATION : gathering->unused;
    } else if (label == CFF_LOST) {
        label = (one > other) ? one : other;
    } else {
        /* two sets become one */
    }
    return label;
}

/* Give both craft and their sets the label; of two lost craft the higher index is the new one. */
static void relabel(cff_gathering_t *gathering, uint32_t low, uint32_t high, cff_join_t *join)
{
    const int32_t one = gathering->labels[low];
    const int32_t other = gathering->labels[high];
    for (uint32_t m = 0U; m < gathering->count; m++) {
        const int32_t label = gathering->labels[m];
        const bool in_either = (label != CFF_LOST) && ((label == one) || (label == other));
        join->joins[m] = in_either && (label != join->label);
        gathering->labels[m] = in_either ? join->label : label;
    }
    join->joins[low] = join->joins[low] || ((one == CFF_LOST) && (other != CFF_LOST));
    join->joins[high] = join->joins[high] || (other == CFF_LOST);
    gathering->labels[low] = join->label;
    gathering->labels[high] = join->label;
}

/* The burns of new craft of the formation set; the first pair agrees on its velocity. */
static void match_velocities(cff_gathering_t *gathering, uint32_t low, uint32_t high, const double velocities_m_s[][3],
                             cff_join_t *join)
{
    const bool first = (gathering->formed == 0U);
    if (first) {
        for (uint32_t i = 0U; i < 3U; i++) {
            const double one = velocities_m_s[low][i];
            const double other = velocities_m_s[high][i];
            double agreed = 0.5 * (one + other);
            agreed = (gathering->first_burn == CFF_LOWER_BURNS) ? other : agreed;
            agreed = (gathering->first_burn == CFF_HIGHER_BURNS) ? one : agreed;
            gathering->velocity_m_s[i] = agreed;
        }
    }
    gathering->formed = 0U;
    for (uint32_t m = 0U; m < gathering->count; m++) {
        if (gathering->labels[m] == CFF_FORMATION) {
            gathering->formed += 1U;
            if (first || join->joins[m]) {
                for (uint32_t i = 0U; i < 3U; i++) {
                    join->delta_v_m_s[m][i] = gathering->velocity_m_s[i] - velocities_m_s[m][i];
                }
            }
        }
    }
}

cff_status_t cff_gathering_begin(cff_gathering_t *gathering, uint32_t count, cff_first_burn_t first_burn)
{
    cff_status_t status = CFF_BAD_INPUT;
    const bool known = (first_burn == CFF_LOWER_BURNS) || (first_burn == CFF_HIGHER_BURNS) || (first_burn == CFF_BOTH_BURN);
    if ((count >= 2U) && (count <= CFF_MOST_CRAFT) && known) {
        gathering->count = count;
        gathering->first_burn = first_burn;
        gathering->unused = 1;
        gathering->formed = 0U;
        gathering->time_s = 0.0;
        for (uint32_t i = 0U; i < 3U; i++) {
            gathering->velocity_m_s[i] = 0.0;
        }
        for (uint32_t m = 0U; m < CFF_MOST_CRAFT; m++) {
            gathering->labels[m] = CFF_LOST;
        }
        status = CFF_OK;
    }
    return status;
}

static bool lock_is_good(const cff_gathering_t *gathering, double time_s, uint32_t i, uint32_t j,
                         const double velocities_m_s[][3])
{
    const uint32_t count = gathering->count;
    bool good = (i != j) && cfi_finite(&time_s, 1U) && (time_s >= gathering->time_s) && (gathering->unused >= 1);
    for (uint32_t m = 0U; (m < count) && good; m++) {
        good = (gathering->labels[m] == CFF_LOST) && (m != i) && (m != j); /* its velocity may be unknown */
        good = good || cfi_finite(velocities_m_s[m], 3U);
    }
    return good;
}

cff_status_t cff_gathering_lock(cff_gathering_t *gathering, double time_s, uint32_t i, uint32_t j,
                                const double velocities_m_s[][3], cff_join_t *join)
{
    cff_status_t status = CFF_BAD_INPUT;
    if ((gathering->count <= CFF_MOST_CRAFT) && (i < gathering->count) && (j < gathering->count) &&
        (gathering->unused < INT32_MAX) && lock_is_good(gathering, time_s, i, j, velocities_m_s)) {
        const uint32_t low = (i < j) ? i : j;
        const uint32_t high = (i < j) ? j : i;
        const int32_t one = gathering->labels[low];
        const int32_t other = gathering->labels[high];
        gathering->time_s = time_s;
        join->table_case = (3U * place_in_table(one)) + place_in_table(other) + 1U;
        join->label = one;
        join->action = CFF_NOTHING_NEW;
        for (uint32_t m = 0U; m < CFF_MOST_CRAFT; m++) {
            join->joins[m] = false;
            join->delta_v_m_s[m][0] = 0.0;
            join->delta_v_m_s[m][1] = 0.0;
            join->delta_v_m_s[m][2] = 0.0;
        }
        if ((one == CFF_LOST) || (one != other)) {
            join->label = joint_label(gathering, one, other);
            gathering->unused += (join->label == gathering->unused) ? 1 : 0;
            relabel(gathering, low, high, join);
            join->action = (join->label == CFF_FORMATION) ? CFF_BURN : CFF_COAST;
            if (join->action == CFF_BURN) {
                match_velocities(gathering, low, high, velocities_m_s, join);
            }
        }
        status = CFF_OK;
    }
    return status;
}
