/* Messages of the conflict monitor. */
#ifndef MONITOR_APP_H
#define MONITOR_APP_H

#include "cfe.h"
#include "closeform_flight.h"

#define MONITOR_PATHS_MID 0x1890  /* command: paths and zone */
#define MONITOR_WAKEUP_MID 0x1891 /* of the scheduler */
#define MONITOR_TLM_MID 0x0890
#define MONITOR_ARCS 8U
#define MONITOR_CONFLICTS 8U
#define MONITOR_BUDGET 256U /* evaluations of a wakeup */

#define MONITOR_PATHS_EID 1
#define MONITOR_CONFLICT_EID 2

typedef struct {
    uint32 own_count;
    uint32 other_count;
    cff_arc_t own[MONITOR_ARCS]; /* rows of `Path.arcs` of the Python package */
    cff_arc_t other[MONITOR_ARCS];
    cff_zone_t zone;
} MONITOR_Paths_t;

typedef struct {
    CFE_MSG_CommandHeader_t CommandHeader;
    MONITOR_Paths_t Payload;
} MONITOR_PathsCmd_t;

typedef struct {
    CFE_MSG_TelemetryHeader_t TelemetryHeader;
    double certified_until_s; /* all conflicts that begin before are known */
    uint32 conflicts;         /* found so far */
    int32 status;             /* cff_status_t of the last call */
} MONITOR_Tlm_t;

void MONITOR_Main(void);

#endif
