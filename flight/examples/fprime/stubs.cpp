// A stand-in for F Prime: it sends the component one buffer and calls of a rate group, and checks what it reports.
#include <cmath>
#include <cstdio>

#include "ConflictMonitor.hpp"

namespace {

int found = 0;
int refused = 0;
double known = 0.0;

}  // namespace

namespace Closeform {

void ConflictMonitorComponentBase::log_WARNING_HI_ConflictFound(F64 start, F64 end) {
    std::printf("conflict from %.3f s to %.3f s\n", start, end);
    found += std::fabs(start - 138.680) < 0.01 && std::fabs(end - 161.320) < 0.01;
}

void ConflictMonitorComponentBase::log_WARNING_HI_PathsNotAccepted(I32 status) {
    std::printf("paths not accepted, status %d\n", status);
    refused++;
}

void ConflictMonitorComponentBase::tlmWrite_CertifiedUntil(F64 time) { known = time; }

}  // namespace Closeform

int main() {
    static Closeform::Paths paths;
    const cff_state_t here = {{0.0, 200.0, 0.0}, {0.0, 0.0, 0.0}};
    const cff_state_t there = {{0.0, -200.0, 0.0}, {0.0, 0.0, 0.0}};
    const cff_state_t client = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    const double half[3] = {20.0, 40.0, 20.0};
    paths.ownCount = 1;
    paths.otherCount = 1;
    cff_transfer(1.1086e-3, 0.0, 300.0, &here, &there, &paths.own[0]);
    cff_drift(1.1086e-3, 0.0, 300.0, &client, &paths.other[0]);
    paths.zone.shape = CFF_ELLIPSOID;
    for (int k = 0; k < 3; k++) {
        paths.zone.to_unit_per_m[k][k] = 1.0 / half[k];
    }
    Closeform::ConflictMonitor monitor("conflictMonitor");
    Closeform::ConflictMonitorComponentBase& component = monitor;
    Fw::Buffer cut(reinterpret_cast<U8*>(&paths), sizeof(paths) - 1U);
    Fw::Buffer whole(reinterpret_cast<U8*>(&paths), sizeof(paths));
    component.pathsIn_handler(0, cut);
    component.pathsIn_handler(0, whole);
    for (int k = 0; k < 100; k++) {
        component.schedIn_handler(0, 0);
    }
    return found == 1 && refused == 1 && known >= 300.0 ? 0 : 1;
}
