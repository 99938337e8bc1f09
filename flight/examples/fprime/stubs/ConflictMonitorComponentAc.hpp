// Stub of what F Prime generates from ConflictMonitor.fpp, to build the component without the framework.
#ifndef Closeform_ConflictMonitorComponentAc_HPP
#define Closeform_ConflictMonitorComponentAc_HPP

#include <cstdint>

using FwIndexType = std::int16_t;
using FwSizeType = std::uint64_t;
using I32 = std::int32_t;
using U8 = std::uint8_t;
using U32 = std::uint32_t;
using F64 = double;

namespace Fw {

class Buffer {
  public:
    Buffer(U8* data, FwSizeType size) : m_data(data), m_size(size) {}
    U8* getData() const { return m_data; }
    FwSizeType getSize() const { return m_size; }

  private:
    U8* m_data;
    FwSizeType m_size;
};

}  // namespace Fw

namespace Closeform {

class ConflictMonitorComponentBase {
  public:
    explicit ConflictMonitorComponentBase(const char*) {}
    virtual ~ConflictMonitorComponentBase() = default;
    virtual void pathsIn_handler(FwIndexType portNum, Fw::Buffer& fwBuffer) = 0;
    virtual void schedIn_handler(FwIndexType portNum, U32 context) = 0;

    void log_WARNING_HI_ConflictFound(F64 start, F64 end);
    void log_WARNING_HI_PathsNotAccepted(I32 status);
    void tlmWrite_CertifiedUntil(F64 time);
};

}  // namespace Closeform
#endif
