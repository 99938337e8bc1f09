#include "ConflictMonitor.hpp"

#include <cstring>

namespace Closeform {

ConflictMonitor::ConflictMonitor(const char* name)
    : ConflictMonitorComponentBase(name), m_paths(), m_search(), m_searching(false) {}

void ConflictMonitor::pathsIn_handler(FwIndexType, Fw::Buffer& fwBuffer) {
    cff_status_t status = CFF_BAD_INPUT;
    if (fwBuffer.getSize() == sizeof(Paths)) {
        std::memcpy(&m_paths, fwBuffer.getData(), sizeof(Paths));
        if (m_paths.ownCount <= ARCS && m_paths.otherCount <= ARCS) {
            cff_path_t own = cff_path_t();
            cff_path_t other = cff_path_t();
            own.arcs = m_paths.own;
            own.count = m_paths.ownCount;
            other.arcs = m_paths.other;
            other.count = m_paths.otherCount;
            status = cff_conflicts_begin(&m_search, &own, &other, &m_paths.zone);
        }
    }
    m_searching = status == CFF_OK;
    if (!m_searching) {
        this->log_WARNING_HI_PathsNotAccepted(status);
    }
}

void ConflictMonitor::schedIn_handler(FwIndexType, U32) {
    if (!m_searching) {
        return;
    }
    cff_conflict_t conflicts[CONFLICTS];
    U32 count = 0;
    const cff_status_t status = cff_conflicts_continue(&m_search, BUDGET, conflicts, CONFLICTS, &count);
    for (U32 k = 0; k < count; k++) {
        this->log_WARNING_HI_ConflictFound(conflicts[k].start_s, conflicts[k].end_s);
    }
    this->tlmWrite_CertifiedUntil(m_search.certified_until_s);
    m_searching = status == CFF_MORE || status == CFF_FULL;
}

}  // namespace Closeform
