#pragma once

#include <stdexcept>
#include <string>

namespace remesh {

/// Why a run ended without a result. Each edge of the program maps every code in one place.
enum class ErrorCode {
    InvalidInput,  ///< The mesh or an option is outside its documented range: fix the request.
    Unsupported,   ///< Well-formed, but this build can't do it (e.g. an unknown file format).
    Unmeshable,    ///< Valid input, but no mesh within the asked bounds was found.
    TooLarge,      ///< A configured limit would be passed: memory, particles, output tets.
    Cancelled,     ///< The caller asked to stop.
    Internal,  ///< A defect of ours or of a library; set only where foreign exceptions are caught.
};

/// The one exception type that `core` throws. `what()` is a sentence for the user.
class Error : public std::runtime_error {
public:
    Error(ErrorCode code, const std::string& message) : std::runtime_error(message), code_(code) {}

    [[nodiscard]] ErrorCode code() const noexcept { return code_; }

private:
    ErrorCode code_;
};

}  // namespace remesh
