// Times of a log that cannot be are told.
#include "experiment/time_check.hpp"

#include <fmt/core.h>
#include <gmock/gmock.h>

#include "tests/support/small_campaign.hpp"

namespace unhand::experiment {
namespace {

using datasets::ThrowLog;
using testing::ElementsAre;
using testing::Field;
using testing::HasSubstr;
using testing::IsEmpty;
using testing_support::small_log;

auto note(const std::string& path, int throws) {
  return testing::AllOf(Field(&LogNote::path, path), Field(&LogNote::throws, throws));
}

TEST(TimeCheck, ACampaignOfOnesOwnIsPossible) { EXPECT_THAT(impossible_times(small_log()), IsEmpty()); }

TEST(TimeCheck, TimesOutsideOfTheHandAreToldWithItsInterval) {
  auto log = small_log();
  const int n = static_cast<int>(log.throws.size());
  log.gripper->opening_command_time = 10;
  log.throws[2].detach_time = 5;
  log.throws[3].hand_jump_times = {0.01, 7};
  const auto notes = impossible_times(log);
  ASSERT_THAT(notes, ElementsAre(note("/gripper@opening_command_time", n),
                                 note("/throws/" + log.throws[2].id + "@detach_time", 1),
                                 note("/throws/" + log.throws[3].id + "@hand_jump_times", 1)));
  const auto& time = log.throws[2].hand->time;
  EXPECT_THAT(
      notes[1].in_words(log.throws.size()),
      HasSubstr(fmt::format("detach_time: is 5 s, and throw {} (hand/time) runs from {:.4g} to {:.4g} s; "
                            "so in 1 of {} throws",
                            log.throws[2].id, time(0), time(time.rows - 1), n)));
}

TEST(TimeCheck, ALandingBeforeTheOpeningIsTold) {
  auto log = small_log();
  log.throws[1].landing->time.data = {0.0};
  const auto notes = impossible_times(log);
  ASSERT_THAT(notes, ElementsAre(note("/throws/" + log.throws[1].id + "/landing/time", 1)));
  EXPECT_THAT(notes[0].said, HasSubstr("not after the gripper's opening at "));
}

TEST(TimeCheck, ALandingAtTheOpeningIsNoneAfterIt) {
  auto log = small_log();
  log.throws[1].landing->time.data = {*log.gripper->opening_command_time};
  EXPECT_THAT(impossible_times(log), ElementsAre(note("/throws/" + log.throws[1].id + "/landing/time", 1)));
}

TEST(TimeCheck, TimesBeforeTheHandBeginsAreToldToo) {
  auto log = small_log();
  log.throws[2].detach_time = log.throws[2].hand->time(0) - 0.5;
  EXPECT_THAT(impossible_times(log), ElementsAre(note("/throws/" + log.throws[2].id + "@detach_time", 1)));
}

// As the file counts: a log whose clock began in 1970 was moved when it was read.
TEST(TimeCheck, ClocksThatShareNoTimeAreTold) {
  for (const double off : {10.0, -10.0, 1.7e9}) {
    auto log = small_log();
    for (auto& one : log.throws)
      for (double& t : one.mocap->time.data) t += off;
    const auto notes = impossible_times(log);
    ASSERT_EQ(notes.size(), 1U) << off;
    EXPECT_THAT(notes[0].said, HasSubstr("they do not overlap"));
    EXPECT_EQ(notes[0].path, "/throws/" + log.throws[0].id + "/mocap/time");
  }
  auto log = small_log();
  log.clock_origin = 100;
  for (double& t : log.throws[0].mocap->time.data) t += 10;
  const auto& mocap = log.throws[0].mocap->time;
  EXPECT_THAT(clocks_apart(log, log.throws[0]),
              HasSubstr(fmt::format("runs from {:.6g} to ", 100 + mocap(0))));
  EXPECT_EQ(clocks_apart(log, log.throws[1]), "");
}

}  // namespace
}  // namespace unhand::experiment
