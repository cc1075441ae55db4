// Every file of the fuzzers' corpus, findings among them: a mesh or an Error, never more; a request
// that is understood or refused.

#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/image/read_image.h"
#include "core/io/mesh_io.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);  // fuzz_request

namespace remesh {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> corpus() {
    std::vector<fs::path> files;
    for (const auto& entry : fs::recursive_directory_iterator(REMESH_FUZZ_CORPUS_DIR)) {
        if (entry.is_regular_file()) {
            files.push_back(entry.path());
        }
    }
    std::sort(files.begin(), files.end());
    return files;
}

class FuzzCorpus : public ::testing::TestWithParam<fs::path> {};

TEST_P(FuzzCorpus, IsReadOrRefused) {
    std::ifstream stream(GetParam(), std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(stream), {}};
    const std::string hint = "." + GetParam().parent_path().filename().string();

    if (hint == ".request") {
        // Aborts if it finds something.
        LLVMFuzzerTestOneInput(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
        return;
    }
    try {
        if (hint == ".image") {
            EXPECT_FALSE(read_size_image(bytes).sizes.empty());
            return;
        }
        const SurfaceMesh mesh = read_surface(bytes, hint).mesh;

        for (const auto& triangle : mesh.triangles) {
            EXPECT_GE(*std::min_element(triangle.begin(), triangle.end()), 0);
            EXPECT_LT(static_cast<std::size_t>(*std::max_element(triangle.begin(), triangle.end())),
                      mesh.vertices.size());
        }
    } catch (const Error& error) {
        EXPECT_STRNE(error.what(), "");
    }
}

std::string name_of(const ::testing::TestParamInfo<fs::path>& info) {
    std::string name =
        info.param.parent_path().filename().string() + "_" + info.param.filename().string();
    std::replace_if(
        name.begin(), name.end(),
        [](char c) { return std::isalnum(static_cast<unsigned char>(c)) == 0; }, '_');
    return name;
}

INSTANTIATE_TEST_SUITE_P(Files, FuzzCorpus, ::testing::ValuesIn(corpus()), name_of);

}  // namespace
}  // namespace remesh
