module Closeform {

  @ Searches two loaded paths for conflicts, a fixed budget at each call of the rate group
  passive component ConflictMonitor {

    @ Paths and zone, as the bytes of Closeform::Paths
    sync input port pathsIn: Fw.BufferSend

    @ Rate group
    sync input port schedIn: Svc.Sched

    @ All conflicts that begin before this time are known
    telemetry CertifiedUntil: F64

    event ConflictFound(start: F64, $end: F64) severity warning high \
      format "Conflict from {} s to {} s"

    event PathsNotAccepted($status: I32) severity warning high \
      format "Paths not accepted, status {}"

    time get port timeCaller
    event port eventOut
    text event port textEventOut
    telemetry port tlmOut

  }

}
