#include <gtest/gtest.h>

#include <limits>
#include <pugixml.hpp>
#include <sstream>

#include "server/report/charts.h"
#include "server/report/page.h"
#include "server/report/picture.h"
#include "tests/support/shapes.h"

namespace remesh::report {
namespace {

RemeshResult result_of(const SurfaceMesh& surface) {
    RemeshResult result;
    result.surface = surface;
    result.edge_length = 0.5;
    result.report.before = measure_surface(surface);
    result.report.after = measure_surface(surface);
    return result;
}

std::string page_of(const JobRequest& request, const RemeshResult& result,
                    const std::vector<JobOutput>& files = {}) {
    std::vector<ConvergenceSample> samples(3);
    for (int i = 0; i < 3; ++i) {
        samples[static_cast<std::size_t>(i)].iteration = i + 1;
        samples[static_cast<std::size_t>(i)].residual_force = 1.0 / (1.0 + i);
        samples[static_cast<std::size_t>(i)].particles = 100;
    }
    std::ostringstream out;
    write_page({.request = request,
                .input = result.surface,
                .result = result,
                .samples = samples,
                .files = files,
                .options = {},
                .engine_version = "1.2.3"},
               out);
    return out.str();
}

pugi::xml_document parsed(const std::string& page) {
    pugi::xml_document document;
    const auto outcome =
        document.load_string(page.c_str(), pugi::parse_default | pugi::parse_doctype);
    EXPECT_TRUE(outcome) << outcome.description() << " at " << outcome.offset;
    return document;
}

TEST(ReportPage, IsWellFormedAndHasItsPictures) {
    const auto document = parsed(page_of({}, result_of(testing::unit_cube())));

    const auto pictures = document.select_nodes("//img");
    ASSERT_EQ(pictures.size(), 2U);
    for (const auto& picture : pictures) {
        const std::string source = picture.node().attribute("src").value();
        EXPECT_EQ(source.rfind("data:image/png;base64,iVBORw0KGgo", 0), 0U);
    }
    // Three of the residual and two of the particles: charts of nothing but zeros have none.
    EXPECT_EQ(document.select_nodes("//polyline").size(), 3U + 2U);
}

TEST(ReportPage, NeedsNothingFromElsewhere) {
    const auto document = parsed(page_of({}, result_of(testing::unit_cube())));

    EXPECT_TRUE(document.select_nodes("//script | //link | //iframe | //a").empty());
    EXPECT_EQ(page_of({}, result_of(testing::unit_cube())).find("http"), std::string::npos);
}

TEST(ReportPage, SaysWhatLengthsAndCoordinatesMean) {
    JobRequest request;
    request.unit = "mm";
    request.space = "LPS";
    RemeshResult result = result_of(testing::unit_cube());
    result.report.defects.push_back({"OPEN_BOUNDARY", "an open rim", 1, Vec3(1.0, 2.0, 3.0)});

    const std::string said = page_of(request, result);
    const std::string unsaid = page_of({}, result);

    EXPECT_NE(said.find("Lengths are in mm, as was said of the file; coordinates are LPS: x to the "
                        "patient's left"),
              std::string::npos);
    EXPECT_NE(said.find("Where: x, y, z, mm, LPS"), std::string::npos);
    EXPECT_NE(said.find("6 mm²"), std::string::npos);
    EXPECT_NE(said.find("1 mm³"), std::string::npos);
    EXPECT_NE(unsaid.find("Lengths are in the unit of the file, which wasn't said; coordinates are "
                          "those of the file, whose space wasn't said."),
              std::string::npos);
    EXPECT_EQ(unsaid.find("mm²"), std::string::npos);
}

TEST(ReportPage, SaysAtOnceThatABoundIsNotKept) {
    RemeshResult result = result_of(testing::unit_cube());
    result.report.bounds = {{"min_dihedral", 60.0, 30.5, false},
                            {"max_volume_change", 0.1, 0.02, true}};

    const std::string draft = page_of({}, result);
    result.report.bounds.erase(result.report.bounds.begin());
    const std::string good = page_of({}, result);

    EXPECT_NE(
        draft.find("it doesn't keep what was asked for.</b> min dihedral is 30.5, the bound is "
                   "60.</p>"),
        std::string::npos);
    EXPECT_LT(draft.find("it doesn't keep"), draft.find("<img"));
    EXPECT_EQ(good.find("A draft"), std::string::npos);
    EXPECT_NE(good.find("Kept, as asked for: max volume change is 0.02, the bound is 0.1."),
              std::string::npos);
}

TEST(ReportPage, KeepsHostileNamesAsText) {
    JobRequest request;
    request.file_name = "</title><script>alert('\"&')</script>";
    RemeshResult result = result_of(testing::unit_cube());
    result.report.defects.push_back({"<b>", "<script>x</script>", 1, std::nullopt});

    const JobOutput file{OutputKind::Surface, MeshFormat::Stl, {}, "<img src='x'/>.stl"};

    const auto document = parsed(page_of(request, result, {file}));

    EXPECT_TRUE(document.select_nodes("//script | //td//* | //th//*").empty());
    EXPECT_EQ(document.select_node("//h1").node().text().get(), request.file_name);
}

TEST(ReportPicture, LeavesOutWhatIsNotFinite) {
    SurfaceMesh surface = testing::unit_cube();
    surface.vertices.push_back(Vec3::Constant(std::numeric_limits<double>::quiet_NaN()));
    surface.triangles.push_back({0, 1, static_cast<Index>(surface.vertices.size() - 1)});

    const Facets facets = facets_of(surface);

    EXPECT_EQ(facets.corners.size(), surface.triangles.size() - 1);
    EXPECT_FALSE(draw_png(facets, upright_view(facets), 64).empty());
}

TEST(ReportPicture, DrawsNothingOfNothing) {
    const Facets facets;

    EXPECT_FALSE(draw_png(facets, upright_view(facets), 16).empty());
}

TEST(ReportCharts, EscapeEverythingThatHtmlReads) {
    EXPECT_EQ(escaped("<a href='x'>\"&\x01"), "&lt;a href=&#39;x&#39;&gt;&quot;&amp; ");
    EXPECT_EQ(count(-1234567), "-1,234,567");
    EXPECT_EQ(count(-123), "-123");
    EXPECT_EQ(count(1000), "1,000");
}

}  // namespace
}  // namespace remesh::report
