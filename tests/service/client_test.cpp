// The client program against a scripted server, over a real channel: what it makes of files and
// jobs.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/service/client_fixture.h"

namespace remesh::client {
namespace {

using nlohmann::json;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;

TEST_F(Client, WritesTheTetsAndTheSurfaceOfOneJob) {
    const auto result =
        remesh({"run", input_, "--edge-length", "2.5", "-o", "a.vtu", "-o", "b.ply"});

    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_EQ(content_of(folder_.path() / "a.vtu"), FakeServer::content_of(v1::FORMAT_VTU));
    EXPECT_EQ(content_of(folder_.path() / "b.ply"), FakeServer::content_of(v1::FORMAT_PLY));
    EXPECT_THAT(folder_.names(), ElementsAre("a.vtu", "b.ply", "in.stl"));
    EXPECT_THAT(server_.jobs(), SizeIs(1));
    EXPECT_EQ(server_.creates().at(0).spec().options().edge_length(), 2.5);
}

TEST_F(Client, PrintsWhatTheMeshWasAndWhatItIs) {
    const auto result = remesh({"run", input_, "--edge-length", "2.5"});

    EXPECT_THAT(result.out, HasSubstr("1,234"));
    EXPECT_THAT(result.out, HasSubstr("56,789"));
    EXPECT_THAT(result.out, HasSubstr("0.943"));
    EXPECT_THAT(result.out, HasSubstr("p99 0.100 h"));
    EXPECT_THAT(result.out, HasSubstr("3 holes were closed"));
    EXPECT_THAT(result.out, HasSubstr("in_remeshed.vtu"));
    EXPECT_THAT(result.err, IsEmpty());
}

TEST_F(Client, TellsTheEdgeLengthThatTheServerChose) {
    const auto result = remesh({"run", input_});

    EXPECT_EQ(result.exit_code, 0);
    EXPECT_THAT(result.out, HasSubstr("edge length h = 1.25 (chosen by the server)"));
    EXPECT_FALSE(server_.creates().at(0).spec().options().has_edge_length());
}

TEST_F(Client, LeavesOptionsThatWerentGivenToTheServer) {
    remesh({"run", input_, "--no-close-holes", "--force", "charged", "--label", "case=7"});

    const v1::JobSpec spec = server_.creates().at(0).spec();
    EXPECT_FALSE(spec.options().prepare().close_holes());
    EXPECT_TRUE(spec.options().prepare().has_close_holes());
    EXPECT_FALSE(spec.options().prepare().has_keep_cavities());
    EXPECT_EQ(spec.options().relaxation().force(), v1::Relaxation::FORCE_CHARGED_PARTICLES);
    EXPECT_FALSE(spec.options().relaxation().has_damping());
    EXPECT_FALSE(spec.options().has_seed());
    EXPECT_EQ(spec.labels().at("case"), "7");
}

TEST_F(Client, AsksForNoTetsWhenOnlyTheSurfaceIsWanted) {
    remesh({"run", input_, "--surface-only"});

    const v1::JobSpec spec = server_.creates().at(0).spec();
    EXPECT_FALSE(spec.options().tetrahedra());
    ASSERT_EQ(spec.outputs_size(), 1);
    EXPECT_EQ(spec.outputs(0).format(), v1::FORMAT_PLY);
}

TEST_F(Client, RefusesToOverwriteItsInput) {
    const std::string input = folder_.file("in.ply", "ply");

    const auto result = remesh({"run", input, "-o", "./in.ply"});

    EXPECT_EQ(result.exit_code, 2);
    EXPECT_EQ(content_of(input), "ply");
    EXPECT_THAT(server_.creates(), IsEmpty());
}

TEST_F(Client, RefusesAFileOfUnknownFormatBeforeAnyWork) {
    const auto result = remesh({"run", input_, "-o", "a.xyz"});

    EXPECT_EQ(result.exit_code, 2);
    EXPECT_THAT(result.last_error_line(), HasSubstr(".ply .vtu .msh"));
    EXPECT_THAT(result.last_error_line(), Not(HasSubstr(".gii")));
    EXPECT_THAT(server_.creates(), IsEmpty());
}

TEST_F(Client, RefusesAFolderThatIsntThereBeforeAnyWork) {
    const auto result = remesh({"run", input_, "-o", "nowhere/a.ply"});

    EXPECT_EQ(result.exit_code, 2);
    EXPECT_THAT(server_.creates(), IsEmpty());
}

TEST_F(Client, LetsFormatChooseBetweenFormatsOfOneExtension) {
    remesh({"run", input_, "-o", "a.msh"});
    remesh({"run", input_, "-o", "a.msh", "--format", "msh22"});

    EXPECT_EQ(server_.creates().at(0).spec().outputs(0).format(), v1::FORMAT_MSH41);
    EXPECT_EQ(server_.creates().at(1).spec().outputs(0).format(), v1::FORMAT_MSH22);
}

TEST_F(Client, SendsBytesOnceThatTheServerHasAlready) {
    remesh({"submit", input_});
    remesh({"submit", input_});

    EXPECT_EQ(server_.uploads_with_bytes(), 1);
    EXPECT_THAT(server_.jobs(), SizeIs(2));
}

TEST_F(Client, SendsALargeFileInChunks) {
    const std::string large = folder_.file("large.stl", std::string(3'000'000, 'x'));

    EXPECT_EQ(remesh({"submit", large}).exit_code, 0);
    EXPECT_EQ(server_.uploads_with_bytes(), 1);
}

TEST_F(Client, SubmitsSeveralFilesAndPrintsANameALine) {
    const std::string other = folder_.file("other.stl", "solid other");

    const auto result = remesh({"submit", input_, other, "--edge-length", "1"});

    EXPECT_EQ(result.out, "tenants/default/jobs/001\ntenants/default/jobs/002\n");
}

TEST_F(Client, ListsEveryPageOneObjectALine) {
    server_.add_job({});
    server_.add_job({});

    const auto result = run_client(folder_, {"list", "--json", "--server", server_.address()});

    const auto lines = json_lines(result.out);
    ASSERT_THAT(lines, SizeIs(2));
    EXPECT_EQ(lines[0]["name"], "tenants/default/jobs/001");
    EXPECT_EQ(lines[0]["state"], "SUCCEEDED");
    EXPECT_EQ(lines[1]["name"], "tenants/default/jobs/002");
}

TEST_F(Client, GetsOutputsByExtension) {
    remesh({"run", input_});

    const auto result =
        remesh({"get", "tenants/default/jobs/001", "-o", "x.ply", "-o", "x.vtu", "-o", "x.json"});

    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_EQ(content_of(folder_.path() / "x.ply"), FakeServer::content_of(v1::FORMAT_PLY));
    EXPECT_EQ(content_of(folder_.path() / "x.vtu"), FakeServer::content_of(v1::FORMAT_VTU));
    EXPECT_EQ(content_of(folder_.path() / "x.json"), "{}");
}

TEST_F(Client, SaysWhatThereIsToGet) {
    remesh({"run", input_});

    const auto result = remesh({"get", "tenants/default/jobs/001", "-o", "x.obj"});

    EXPECT_EQ(result.exit_code, 3);
    EXPECT_THAT(result.last_error_line(),
                HasSubstr("mesh.vtu (tetrahedra), mesh.ply (surface), report.json (report)"));
}

TEST_F(Client, PicksAnOutputByItsKindWhateverTheName) {
    remesh({"run", input_});
    const auto get = [&](const std::string& kind) {
        return remesh({"get", "tenants/default/jobs/001", "--kind", kind, "-o", "x.obj"});
    };

    EXPECT_EQ(get("surface").exit_code, 0);
    EXPECT_EQ(content_of(folder_.path() / "x.obj"), FakeServer::content_of(v1::FORMAT_PLY));
    const auto absent = get("preview_tetrahedra");
    EXPECT_EQ(absent.exit_code, 3);
    EXPECT_THAT(absent.last_error_line(), HasSubstr("no output for preview_tetrahedra"));
    EXPECT_EQ(get("tets").exit_code, 2);
}

TEST_F(Client, KeepsControlCharactersOfALabelFromTheTerminal) {
    v1::Job job;
    (*job.mutable_spec()->mutable_labels())["note"] = "\x1b[2Jred\x07";
    const std::string name = server_.add_job(job).name();

    const auto result = remesh({"show", name});

    EXPECT_THAT(result.out, HasSubstr("note=?[2Jred?"));
}

TEST_F(Client, ReadsStdinAndWritesStdout) {
    const auto result = remesh({"run", "-", "-o", "-", "--format", "ply"}, "solid from a pipe");

    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_EQ(result.out, FakeServer::content_of(v1::FORMAT_PLY));
    EXPECT_THAT(result.err, HasSubstr("wrote -"));
}

}  // namespace
}  // namespace remesh::client
