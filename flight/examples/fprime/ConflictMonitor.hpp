// Conflict monitor as an F Prime component.
#ifndef Closeform_ConflictMonitor_HPP
#define Closeform_ConflictMonitor_HPP

#include "ConflictMonitorComponentAc.hpp"

#include "closeform_flight.h"

namespace Closeform {

constexpr U32 ARCS = 8;
constexpr U32 CONFLICTS = 8;  // of a call of the rate group
constexpr U32 BUDGET = 256;   // evaluations of a call

// What the buffer of `pathsIn` holds: rows of `Path.arcs` of the Python package, and the zone.
struct Paths {
    U32 ownCount;
    U32 otherCount;
    cff_arc_t own[ARCS];
    cff_arc_t other[ARCS];
    cff_zone_t zone;
};

class ConflictMonitor final : public ConflictMonitorComponentBase {
  public:
    explicit ConflictMonitor(const char* name);

  private:
    void pathsIn_handler(FwIndexType portNum, Fw::Buffer& fwBuffer) override;
    void schedIn_handler(FwIndexType portNum, U32 context) override;

    Paths m_paths;  // the search refers to them until it ends
    cff_conflict_search_t m_search;
    bool m_searching;
};

}  // namespace Closeform
#endif
