// Feeds bytes to what looks at a CreateJobRequest before anything is stored. Whatever they are, the
// answer is a spec that decodes to itself, or a JobError.

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "server/convert.h"
#include "server/jobs/remesh_engine.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    remesh::v1::CreateJobRequest request;
    if (!request.ParseFromArray(data, static_cast<int>(size))) {
        return 0;
    }
    try {
        remesh::require_own("default", request.parent());
        static_cast<void>(remesh::job_key_of("default", request.request_id()));
    } catch (const remesh::JobError&) {
    } catch (const remesh::AccessError&) {
    }
    try {
        const std::string spec = remesh::canonical_spec(request.spec());
        remesh::v1::JobSpec again;
        if (!again.ParseFromString(spec) || remesh::canonical_spec(again) != spec) {
            std::abort();
        }
        const remesh::RemeshEngine engine;
        static_cast<void>(engine.check(remesh::ProtoCodec().decode_spec(spec)));
    } catch (const remesh::JobError&) {
    }
    return 0;
}
