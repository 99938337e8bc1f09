/* A stand-in for cFE: it sends the application one command and wakeups, and checks what the application reports. */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "monitor_app.h"

#define WAKEUPS 100U

static union {
    CFE_SB_Buffer_t buffer;
    MONITOR_PathsCmd_t command;
} message;
static MONITOR_Tlm_t last;
static uint32 received;
static uint32 events;

bool CFE_ES_RunLoop(uint32 *RunStatus) { return (*RunStatus == CFE_ES_RunStatus_APP_RUN) && (received <= WAKEUPS); }

void CFE_ES_ExitApp(uint32 ExitStatus)
{
    const bool good = (ExitStatus == CFE_ES_RunStatus_APP_RUN) && (events == 1U) && (last.conflicts == 1U) &&
                      (last.status == CFF_OK) && (last.certified_until_s >= 300.0);
    exit(good ? 0 : 1);
}

CFE_Status_t CFE_EVS_Register(const void *Filters, uint16 NumEventFilters, uint16 FilterScheme)
{
    (void)Filters;
    return ((NumEventFilters == 0U) && (FilterScheme == CFE_EVS_EventFilter_BINARY)) ? CFE_SUCCESS : -1;
}

CFE_Status_t CFE_EVS_SendEvent(uint16 EventID, CFE_EVS_EventType_Enum_t EventType, const char *Spec, ...)
{
    va_list arguments;
    va_start(arguments, Spec);
    printf("event %u, type %d: ", (unsigned)EventID, (int)EventType);
    vprintf(Spec, arguments);
    printf("\n");
    va_end(arguments);
    events++;
    return CFE_SUCCESS;
}

CFE_Status_t CFE_MSG_Init(CFE_MSG_Message_t *MsgPtr, CFE_SB_MsgId_t MsgId, CFE_MSG_Size_t Size)
{
    MsgPtr->Id = MsgId;
    MsgPtr->Size = Size;
    return CFE_SUCCESS;
}

CFE_Status_t CFE_MSG_GetMsgId(const CFE_MSG_Message_t *MsgPtr, CFE_SB_MsgId_t *MsgId)
{
    *MsgId = MsgPtr->Id;
    return CFE_SUCCESS;
}

CFE_Status_t CFE_MSG_GetSize(const CFE_MSG_Message_t *MsgPtr, CFE_MSG_Size_t *Size)
{
    *Size = MsgPtr->Size;
    return CFE_SUCCESS;
}

CFE_Status_t CFE_SB_CreatePipe(CFE_SB_PipeId_t *PipeIdPtr, uint16 Depth, const char *PipeName)
{
    *PipeIdPtr = 1U;
    return ((Depth > 0U) && (strlen(PipeName) < 20U)) ? CFE_SUCCESS : -1;
}

CFE_Status_t CFE_SB_Subscribe(CFE_SB_MsgId_t MsgId, CFE_SB_PipeId_t PipeId)
{
    return ((MsgId.Value != 0U) && (PipeId == 1U)) ? CFE_SUCCESS : -1;
}

/* First the command with paths and zone, then wakeups. */
CFE_Status_t CFE_SB_ReceiveBuffer(CFE_SB_Buffer_t **BufPtr, CFE_SB_PipeId_t PipeId, int32 TimeOut)
{
    const cff_state_t here = {{0.0, 200.0, 0.0}, {0.0, 0.0, 0.0}};
    const cff_state_t there = {{0.0, -200.0, 0.0}, {0.0, 0.0, 0.0}};
    const cff_state_t client = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    MONITOR_Paths_t *paths = &message.command.Payload;
    CFE_MSG_Message_t *head = CFE_MSG_PTR(message.command.CommandHeader);
    if (received == 0U) {
        paths->own_count = 1U;
        paths->other_count = 1U;
        (void)cff_transfer(1.1086e-3, 0.0, 300.0, &here, &there, &paths->own[0]);
        (void)cff_drift(1.1086e-3, 0.0, 300.0, &client, &paths->other[0]);
        paths->zone.shape = CFF_ELLIPSOID;
        paths->zone.to_unit_per_m[0][0] = 1.0 / 20.0;
        paths->zone.to_unit_per_m[1][1] = 1.0 / 40.0;
        paths->zone.to_unit_per_m[2][2] = 1.0 / 20.0;
        (void)CFE_MSG_Init(head, CFE_SB_ValueToMsgId(MONITOR_PATHS_MID), sizeof(MONITOR_PathsCmd_t));
    } else {
        (void)CFE_MSG_Init(head, CFE_SB_ValueToMsgId(MONITOR_WAKEUP_MID), sizeof(CFE_MSG_CommandHeader_t));
    }
    received++;
    *BufPtr = &message.buffer;
    return ((PipeId == 1U) && (TimeOut == CFE_SB_PEND_FOREVER)) ? CFE_SUCCESS : -1;
}

CFE_Status_t CFE_SB_TransmitMsg(const CFE_MSG_Message_t *MsgPtr, bool IncrementSequence)
{
    memcpy(&last, MsgPtr, sizeof(last));
    printf("certified until %.3f s, %u conflicts, status %d\n", last.certified_until_s, (unsigned)last.conflicts, (int)last.status);
    return IncrementSequence ? CFE_SUCCESS : -1;
}

void CFE_SB_TimeStampMsg(CFE_MSG_Message_t *MsgPtr) { (void)MsgPtr; }

CFE_SB_MsgId_t CFE_SB_ValueToMsgId(CFE_SB_MsgId_Atom_t MsgIdValue)
{
    const CFE_SB_MsgId_t id = {MsgIdValue};
    return id;
}

CFE_SB_MsgId_Atom_t CFE_SB_MsgIdToValue(CFE_SB_MsgId_t MsgId) { return MsgId.Value; }

int main(void)
{
    MONITOR_Main();
    return 1; /* CFE_ES_ExitApp does not return */
}
