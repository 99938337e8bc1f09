/*
 * Conflict monitor as a cFS application (cFE 7): a command loads two paths and a zone; each wakeup of the scheduler
 * spends a fixed budget on the search, sends an event for each conflict, and reports until when all are known.
 */
#include "monitor_app.h"

static struct {
    CFE_SB_PipeId_t pipe;
    MONITOR_Paths_t paths; /* the search refers to them until it ends */
    cff_conflict_search_t search;
    MONITOR_Tlm_t tlm;
    bool searching;
} app;

static CFE_Status_t init(void)
{
    CFE_Status_t status = CFE_EVS_Register(NULL, 0, CFE_EVS_EventFilter_BINARY);
    if (status == CFE_SUCCESS) {
        status = CFE_SB_CreatePipe(&app.pipe, 8, "MONITOR_PIPE");
    }
    if (status == CFE_SUCCESS) {
        status = CFE_SB_Subscribe(CFE_SB_ValueToMsgId(MONITOR_PATHS_MID), app.pipe);
    }
    if (status == CFE_SUCCESS) {
        status = CFE_SB_Subscribe(CFE_SB_ValueToMsgId(MONITOR_WAKEUP_MID), app.pipe);
    }
    if (status == CFE_SUCCESS) {
        status = CFE_MSG_Init(CFE_MSG_PTR(app.tlm.TelemetryHeader), CFE_SB_ValueToMsgId(MONITOR_TLM_MID), sizeof(app.tlm));
    }
    return status;
}

static void report(cff_status_t status)
{
    app.tlm.status = (int32)status;
    app.tlm.certified_until_s = app.search.certified_until_s;
    CFE_SB_TimeStampMsg(CFE_MSG_PTR(app.tlm.TelemetryHeader));
    (void)CFE_SB_TransmitMsg(CFE_MSG_PTR(app.tlm.TelemetryHeader), true);
}

static void load_paths(const MONITOR_Paths_t *given)
{
    cff_status_t status = CFF_BAD_INPUT;
    app.paths = *given;
    app.tlm.conflicts = 0U;
    if ((app.paths.own_count <= MONITOR_ARCS) && (app.paths.other_count <= MONITOR_ARCS)) {
        const cff_path_t own = {.arcs = app.paths.own, .count = app.paths.own_count};
        const cff_path_t other = {.arcs = app.paths.other, .count = app.paths.other_count};
        status = cff_conflicts_begin(&app.search, &own, &other, &app.paths.zone);
    }
    app.searching = (status == CFF_OK);
    if (!app.searching) {
        (void)CFE_EVS_SendEvent(MONITOR_PATHS_EID, CFE_EVS_EventType_ERROR, "MONITOR: paths not accepted, status %d", (int)status);
    }
}

static void wakeup(void)
{
    if (app.searching) {
        cff_conflict_t conflicts[MONITOR_CONFLICTS];
        uint32 count = 0U;
        const cff_status_t status =
            cff_conflicts_continue(&app.search, MONITOR_BUDGET, conflicts, MONITOR_CONFLICTS, &count);
        for (uint32 k = 0U; k < count; k++) {
            (void)CFE_EVS_SendEvent(MONITOR_CONFLICT_EID, CFE_EVS_EventType_CRITICAL, "MONITOR: conflict from %.3f s to %.3f s",
                                    conflicts[k].start_s, conflicts[k].end_s);
        }
        app.tlm.conflicts += count;
        app.searching = (status == CFF_MORE) || (status == CFF_FULL);
        report(status);
    }
}

static void process(const CFE_SB_Buffer_t *buffer)
{
    CFE_SB_MsgId_t id;
    CFE_MSG_Size_t size = 0;
    (void)CFE_MSG_GetMsgId(&buffer->Msg, &id);
    (void)CFE_MSG_GetSize(&buffer->Msg, &size);
    if (CFE_SB_MsgIdToValue(id) == MONITOR_WAKEUP_MID) {
        wakeup();
    } else if ((CFE_SB_MsgIdToValue(id) == MONITOR_PATHS_MID) && (size == sizeof(MONITOR_PathsCmd_t))) {
        load_paths(&((const MONITOR_PathsCmd_t *)(const void *)buffer)->Payload);
    } else {
        (void)CFE_EVS_SendEvent(MONITOR_PATHS_EID, CFE_EVS_EventType_ERROR, "MONITOR: unknown message");
    }
}

void MONITOR_Main(void)
{
    uint32 run = CFE_ES_RunStatus_APP_RUN;
    if (init() != CFE_SUCCESS) {
        run = CFE_ES_RunStatus_APP_ERROR;
    }
    while (CFE_ES_RunLoop(&run)) {
        CFE_SB_Buffer_t *buffer = NULL;
        if (CFE_SB_ReceiveBuffer(&buffer, app.pipe, CFE_SB_PEND_FOREVER) == CFE_SUCCESS) {
            process(buffer);
        } else {
            run = CFE_ES_RunStatus_APP_ERROR;
        }
    }
    CFE_ES_ExitApp(run);
}
