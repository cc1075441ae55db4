// The client's flags for sizes, and what they put into a job's options.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "client/sizing_options.h"
#include "tests/support/temporary_directory.h"

namespace remesh::client {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

v1::Sizing parsed(std::vector<std::string> arguments) {
    v1::Sizing sizing;
    CLI::App app;
    add_sizing_options(app, sizing);
    std::reverse(arguments.begin(), arguments.end());
    app.parse(arguments);
    return sizing;
}

std::string refusal_of(const std::vector<std::string>& arguments) {
    try {
        parsed(arguments);
    } catch (const CLI::ParseError& error) {
        return error.what();
    }
    return "";
}

TEST(SizingFlags, LeaveAbsentWhatIsntGiven) {
    EXPECT_EQ(parsed({}).ByteSizeLong(), 0U);
}

TEST(SizingFlags, ChooseHowSizesSpread) {
    const v1::Sizing sizing = parsed({"--propagation", "multigrid", "--reaction", "-0.25"});

    EXPECT_EQ(sizing.propagation(), v1::Sizing::PROPAGATION_MULTIGRID);
    EXPECT_EQ(sizing.reaction(), -0.25);
    EXPECT_THAT(refusal_of({"--propagation", "diffusion"}),
                HasSubstr("{coupled,lipschitz,multigrid}"));
}

TEST(SizingFlags, SetNumbers) {
    const v1::Sizing sizing =
        parsed({"--min-size", "0.5", "--max-size", "4", "--gradation", "0.1", "--size-curvature",
                "0.05", "--size-across", "3", "--size-field", "thickness", "--return-sizes"});

    EXPECT_EQ(sizing.min_size(), 0.5);
    EXPECT_EQ(sizing.max_size(), 4.0);
    EXPECT_EQ(sizing.gradation(), 0.1);
    EXPECT_EQ(sizing.chord_error(), 0.05);
    EXPECT_EQ(sizing.elements_across(), 3.0);
    EXPECT_EQ(sizing.vertex_field(), "thickness");
    EXPECT_TRUE(sizing.return_field());
}

TEST(SizingFlags, ReadALayerWithOrWithoutItsGrowth) {
    EXPECT_EQ(parsed({"--size-layer", "0.4"}).boundary_layer().first_size(), 0.4);
    EXPECT_FALSE(parsed({"--size-layer", "0.4"}).boundary_layer().has_growth());
    EXPECT_EQ(parsed({"--size-layer", "0.4,1.15"}).boundary_layer().growth(), 1.15);
}

TEST(SizingFlags, ReadRegionsOfEveryShape) {
    const v1::Sizing sizing = parsed(
        {"--size-region", "sphere:1,2,3,4:0.5", "--size-region", "box:-1,-2,-3,1,2,3:0.6:1.1",
         "--size-region", "points:1,2,3:0.7", "--size-region", "polyline:0,0,0,1e1,0,0:0.8"});

    ASSERT_EQ(sizing.regions_size(), 4);
    EXPECT_THAT(sizing.regions(0).sphere().center(), ElementsAre(1, 2, 3));
    EXPECT_EQ(sizing.regions(0).sphere().radius(), 4.0);
    EXPECT_EQ(sizing.regions(0).size(), 0.5);
    EXPECT_FALSE(sizing.regions(0).has_growth());
    EXPECT_THAT(sizing.regions(1).box().low(), ElementsAre(-1, -2, -3));
    EXPECT_THAT(sizing.regions(1).box().high(), ElementsAre(1, 2, 3));
    EXPECT_EQ(sizing.regions(1).growth(), 1.1);
    EXPECT_THAT(sizing.regions(2).points().coordinates(), ElementsAre(1, 2, 3));
    EXPECT_THAT(sizing.regions(3).polyline().coordinates(), ElementsAre(0, 0, 0, 10, 0, 0));
}

TEST(SizingFlags, SayHowARegionIsWritten) {
    for (const std::string region : {"sphere:1,2,3:0.5", "cone:1,2,3,4:0.5", "points:1,2,x:0.5",
                                     "box:0,0,0,1,1,1", "polyline:0,0,0:1"}) {
        EXPECT_THAT(refusal_of({"--size-region", region}), HasSubstr("sphere:X,Y,Z,R:H"));
    }
    EXPECT_THAT(refusal_of({"--size-layer", "a"}), HasSubstr("FIRST or FIRST,GROWTH"));
}

TEST(SizingFlags, WinOverTheFile) {
    const remesh::testing::TemporaryDirectory directory;
    const std::string path = (directory.path() / "sizes.json").string();
    std::ofstream(path) << R"({"gradation": 0.1, "min_size": 2,
        "regions": [{"sphere": {"center": [1, 2, 3], "radius": 4}, "size": 0.5}]})";

    const v1::Sizing sizing = parsed({"--gradation", "0.25", "--sizing", path});

    EXPECT_EQ(sizing.gradation(), 0.25);
    EXPECT_EQ(sizing.min_size(), 2.0);
    EXPECT_EQ(sizing.regions(0).size(), 0.5);
}

TEST(SizingFlags, SayWhatIsWrongWithTheFile) {
    const remesh::testing::TemporaryDirectory directory;
    const std::string path = (directory.path() / "sizes.json").string();
    std::ofstream(path) << R"({"gradatoin": 0.1})";

    EXPECT_THAT(refusal_of({"--sizing", path}), HasSubstr("gradatoin"));
    EXPECT_THAT(refusal_of({"--sizing", path + "x"}), HasSubstr("can't read"));
}

}  // namespace
}  // namespace remesh::client
