#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>
#include <string>
#include <vector>

#include "server/jobs/remesh_engine.h"
#include "tests/support/shapes.h"

namespace remesh {
namespace {

// Keeps what is written; the digest is the number of the file.
class Files final : public OutputSink {
public:
    ArtifactId add(const Writer& write) override {
        std::ostringstream out;
        write(out);
        written_.push_back(out.str());
        return {std::to_string(written_.size() - 1),
                static_cast<std::int64_t>(written_.back().size())};
    }

    [[nodiscard]] const std::string& of(const JobOutput& output) const {
        return written_.at(std::stoul(output.artifact.sha256));
    }
    [[nodiscard]] std::size_t count() const { return written_.size(); }

private:
    std::vector<std::string> written_{};
};

JobResult remesh_ball(const std::vector<MeshFormat>& formats, const RemeshOptions& options,
                      Files& files) {
    std::ostringstream input;
    write_surface(testing::icosphere(3), MeshFormat::Ply, input);
    JobRequest request;
    request.options = options;
    for (const MeshFormat format : formats) {
        request.outputs.push_back({format});
    }
    RunContext run;
    return RemeshEngine().run(request, {input.str()}, run, files);
}

const JobOutput& output_of(const JobResult& result, OutputKind kind) {
    return *std::find_if(result.outputs.begin(), result.outputs.end(),
                         [&](const JobOutput& output) { return output.kind == kind; });
}

TEST(RemeshEngine, ShowsTheMeshItself) {
    Files files;

    const auto result =
        remesh_ball({MeshFormat::Stl}, {.edge_length = 0.036, .tetrahedra = false}, files);

    const auto preview = read_surface(files.of(output_of(result, OutputKind::Preview)), ".ply");
    ASSERT_GT(result.report.after.triangles, 20'000);
    EXPECT_EQ(static_cast<std::int64_t>(preview.mesh.triangles.size()),
              result.report.after.triangles);
}

TEST(RemeshEngine, ShowsTetsWhereNoBrowserReadsTheWantedFormat) {
    Files files;

    const auto result = remesh_ball({MeshFormat::Msh41}, {.edge_length = 0.25}, files);

    EXPECT_THAT(files.of(output_of(result, OutputKind::PreviewTetrahedra)),
                ::testing::HasSubstr("UnstructuredGrid"));
}

TEST(RemeshEngine, ShowsWhatItWroteAnywayWhereABrowserReadsThat) {
    Files files;

    const auto result =
        remesh_ball({MeshFormat::Ply, MeshFormat::Vtu}, {.edge_length = 0.25}, files);

    EXPECT_EQ(output_of(result, OutputKind::Preview).artifact.sha256,
              output_of(result, OutputKind::Surface).artifact.sha256);
    EXPECT_EQ(output_of(result, OutputKind::PreviewTetrahedra).artifact.sha256,
              output_of(result, OutputKind::Tetrahedra).artifact.sha256);
    EXPECT_EQ(files.count(), 4U);  // With the report and its page.
}

}  // namespace
}  // namespace remesh
