// The client's words: what is printed, and how others' text is made harmless.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/failure.h"
#include "client/formats.h"
#include "client/json.h"
#include "client/progress.h"
#include "client/sha256.h"
#include "client/tables.h"
#include "client/text.h"

namespace remesh::client {
namespace {

using testing::HasSubstr;

TEST(Sanitised, KeepsPlainTextAndUmlauts) {
    EXPECT_EQ(sanitised("Herzkammer, größer: 左心房"), "Herzkammer, größer: 左心房");
}

TEST(Sanitised, TakesControlCharactersAway) {
    EXPECT_EQ(sanitised("\x1b[31mred\x07\x7f"), "?[31mred??");
    EXPECT_EQ(sanitised("a\nb\tc\r"), "a b c?");
    EXPECT_EQ(sanitised("\xc2\x9b"
                        "2J"),
              "?2J");  // CSI as one C1 character.
}

TEST(Sanitised, TakesAwayWhatTurnsTextAround) {
    EXPECT_EQ(sanitised("lts.\u202Eexe"), "lts.?exe");
    EXPECT_EQ(sanitised("a\u2066b"), "a?b");
}

TEST(Sanitised, ReplacesBytesThatArentUtf8) {
    EXPECT_EQ(sanitised("\xff\xc0\x80z"), "???z");
    EXPECT_EQ(sanitised("\xed\xa0\x80"), "???");  // Half a surrogate pair.
    EXPECT_EQ(sanitised("\xe2\x82"), "??");       // Cut off.
    EXPECT_EQ(sanitised(std::string_view("\0", 1)), "?");
}

TEST(Words, GroupThousands) {
    EXPECT_EQ(with_thousands(0), "0");
    EXPECT_EQ(with_thousands(999), "999");
    EXPECT_EQ(with_thousands(1'000), "1,000");
    EXPECT_EQ(with_thousands(-1'234'567), "-1,234,567");
    EXPECT_EQ(with_thousands(-123), "-123");
}

TEST(Words, TellBytesAndDurations) {
    EXPECT_EQ(bytes_word(999), "999 B");
    EXPECT_EQ(bytes_word(1'234'567), "1.2 MB");
    EXPECT_EQ(bytes_word(999'999), "1.0 MB");
    EXPECT_EQ(duration_word(1.25), "1.2 s");
    EXPECT_EQ(duration_word(59.99), "1 min 0 s");
    EXPECT_EQ(duration_word(7'260), "2 h 1 min");
}

TEST(Words, DropThePrefixOfEnumerations) {
    EXPECT_EQ(state_word(v1::Job::STATE_SUCCEEDED), "SUCCEEDED");
    EXPECT_EQ(stage_word(v1::STAGE_RELAX), "relax");
    EXPECT_EQ(format_word(v1::FORMAT_MSH41), "msh41");
}

TEST(Words, AlignColumnsByCharactersNotBytes) {
    EXPECT_EQ(aligned({{"ä", "1"}, {"bb", "22"}}), "ä    1\nbb  22\n");
}

TEST(Formats, NameTheOutputAfterTheInput) {
    EXPECT_EQ(stem_of("/a/b/aorta.stl"), "aorta");
    EXPECT_EQ(stem_of("aorta.v2.STL.gz"), "aorta.v2");
    EXPECT_EQ(stem_of("-"), "stdin");
}

TEST(Formats, ThatArentThereAreAUsageError) {
    EXPECT_EQ(format_named("MSH22"), v1::FORMAT_MSH22);
    EXPECT_THROW(static_cast<void>(format_named("docx")), Failure);
    EXPECT_THROW(static_cast<void>(format_named("unspecified")), Failure);
}

TEST(Json, HasWordsForEnumerationsAndNumbersForNumbers) {
    v1::Job job;
    job.set_name("n");
    job.set_state(v1::Job::STATE_SUCCEEDED);
    job.set_last_sequence(1LL << 60);
    job.mutable_create_time()->set_seconds(0);
    job.mutable_spec()->mutable_options()->set_edge_length(1.5);
    job.mutable_spec()->mutable_options()->mutable_prepare()->set_smoothing(
        v1::Prepare::SMOOTHING_OFF);
    (*job.mutable_spec()->mutable_labels())["k"] = "v";

    const auto json = to_json(job);

    EXPECT_EQ(json["state"], "SUCCEEDED");
    EXPECT_EQ(json["last_sequence"], 1LL << 60);
    EXPECT_EQ(json["create_time"], "1970-01-01T00:00:00Z");
    EXPECT_EQ(json["spec"]["options"]["edge_length"], 1.5);
    EXPECT_EQ(json["spec"]["options"]["prepare"]["smoothing"], "OFF");
    EXPECT_EQ(json["spec"]["labels"]["k"], "v");
    EXPECT_FALSE(json.contains("result"));
    EXPECT_FALSE(json["spec"]["options"].contains("seed"));
}

TEST(Json, IsOneAsciiLineWhateverItHolds) {
    v1::Warning warning;
    warning.set_message("a\nb\x1b\u202E");

    EXPECT_THAT(json_line(warning), HasSubstr(R"("a\nb\u001b\u202e")"));
}

TEST(Sha256, GivesTheDigestOfTheStandard) {
    Sha256 sha;
    sha.update(std::string("ab"));
    sha.update(std::string("c"));
    EXPECT_EQ(sha.finish(), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

TEST(ProgressLine, ShowsStageResidualAndQuality) {
    v1::JobEvent sample;
    sample.mutable_sample()->set_iteration(120);
    sample.mutable_sample()->set_particles(12'340);
    sample.mutable_sample()->set_residual_force(3.2e-4);
    sample.mutable_sample()->mutable_quality()->set_mean(0.943);
    v1::JobEvent snapshot;
    snapshot.mutable_snapshot()->set_state(v1::Job::STATE_RUNNING);
    v1::JobEvent progress;
    progress.mutable_progress()->set_stage(v1::STAGE_RELAX);
    progress.mutable_progress()->set_fraction(0.5);
    ProgressState state;

    state.apply(snapshot);
    state.apply(progress);
    state.apply(sample);

    EXPECT_EQ(progress_line(state, 75, 200),
              "[==========          ]  50 %  relax           1:15  iteration 120  "
              "residual 3.2e-04  quality 0.943  12,340 particles");
}

TEST(ProgressLine, LeavesOutWhatDoesntFit) {
    ProgressState state;
    state.state = v1::Job::STATE_RUNNING;
    state.particles = 1'000'000;

    for (const int width : {0, 10, 30, 40, 50, 60}) {
        EXPECT_LE(columns(progress_line(state, 1, width)), static_cast<std::size_t>(width));
    }
}

TEST(ProgressLine, TellsThePlaceInTheQueue) {
    ProgressState state;
    state.state = v1::Job::STATE_QUEUED;
    state.queue_position = 3;

    EXPECT_EQ(progress_line(state, 1, 80), "queued, 3 ahead  0:01");
}

TEST(QualityTable, LeavesTetsOutWhenThereAreNone) {
    v1::Quality quality;
    quality.set_edge_length(2.0);
    quality.set_volume_change(-0.0123);
    quality.mutable_output_to_input()->set_max(1.0);

    const std::string table = quality_table(quality);

    EXPECT_THAT(table, testing::Not(HasSubstr("tetrahedra")));
    EXPECT_THAT(table, HasSubstr("-1.23 %"));
    EXPECT_THAT(table, HasSubstr("largest 0.500 h"));
    EXPECT_THAT(table, HasSubstr("no defects found"));
}

TEST(QualityTable, CallsAnOpenInputOpenInsteadOfTellingAVolume) {
    v1::Quality quality;
    quality.mutable_before()->set_volume(123.0);
    quality.mutable_after()->set_volume(456.0);
    EXPECT_THAT(quality_table(quality), HasSubstr("123"));
    quality.add_defects()->set_code("OPEN_BOUNDARY");

    const std::string table = quality_table(quality);

    EXPECT_THAT(table, testing::Not(HasSubstr("123")));
    EXPECT_THAT(table, testing::AllOf(HasSubstr("open"), HasSubstr("456")));
}

TEST(ExitCode, FollowsTheReasonOfAFailure) {
    v1::Job job;
    job.set_state(v1::Job::STATE_FAILED);
    job.mutable_failure()->set_reason("UNSUPPORTED");
    EXPECT_EQ(exit_code_of(job), ExitCode::BadInput);
    job.mutable_failure()->set_reason("TOO_LARGE");
    EXPECT_EQ(exit_code_of(job), ExitCode::JobFailed);
    job.set_state(v1::Job::STATE_QUARANTINED);
    EXPECT_EQ(exit_code_of(job), ExitCode::JobFailed);
}

}  // namespace
}  // namespace remesh::client
