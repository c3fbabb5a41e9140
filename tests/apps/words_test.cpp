// What the command says of numbers and of effects, without running it.
#include <gmock/gmock.h>

#include <tuple>
#include <vector>

#include "apps/ranking.hpp"
#include "apps/table.hpp"
#include "apps/weak_grip.hpp"

namespace unhand::apps {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

TEST(Rounded, IsAsFarAsTheSigmaSays) {
  EXPECT_EQ(with_sigma(0.0500087, 7.2e-5, "m"), "0.050009 ± 0.000072 m");
  EXPECT_EQ(with_sigma(19.7109, 1.1, "1/m"), "19.7 ± 1.1 1/m");
  EXPECT_EQ(with_sigma(0.982122, 2e-4, "-"), "0.98212 ± 0.00020");
  EXPECT_EQ(with_sigma(-1.2345, 0.0996, ""), "-1.23 ± 0.10") << "the sigma is rounded first";
  EXPECT_EQ(with_sigma(123456, 2345, "N"), "123500 ± 2300 N");
  EXPECT_EQ(with_sigma(0.5, 300, "-"), "0 ± 300");
  EXPECT_EQ(with_sigma(1.8123e-7, 9.2e-8, "m/N"), "1.81e-07 ± 9.2e-08 m/N");
  EXPECT_EQ(with_sigma(1.234567e-12, 4.56e-14, "m"), "1.235e-12 ± 4.6e-14 m");
  EXPECT_EQ(with_sigma(0.25, INFINITY, "-"), "0.25 ± inf");
  EXPECT_EQ(with_sigma(0.25, 0, "-"), "0.25 (held)");
  EXPECT_EQ(with_sigma(1, 1e-16, "m"), "1 m (held)") << "a sigma of rounding errors is none";
  EXPECT_EQ(p_text(0.0234), "0.023");
  EXPECT_EQ(p_text(3.21e-12), "3.2e-12");
  EXPECT_EQ(p_text(0), "< 1e-300") << "no probability is 0";
}

TEST(Fixed, HasNoMinusZero) {
  EXPECT_EQ(fixed(true, -1e-9, 3), "0.000");
  EXPECT_EQ(fixed(true, -0.0, 0), "0");
  EXPECT_EQ(fixed(true, -0.0006, 3), "-0.001");
  EXPECT_EQ(fixed(true, -20, 0), "-20");
  EXPECT_EQ(fixed(true, -INFINITY, 1), "-inf");
  EXPECT_EQ(fixed(false, 1, 1), "-");
  EXPECT_EQ(with_sign(-1e-9, 4), "+0.0000");
  EXPECT_EQ(with_sign(-0.25, 2), "-0.25");
  EXPECT_EQ(with_sign(1, 1), "+1.0");
}

TEST(MeanAndSpread, OfASingleNumberHasNoSpread) {
  EXPECT_EQ(mean_and_spread(0, 0, 0, 2), "-");
  EXPECT_EQ(mean_and_spread(1, 0.125, 0, 3), "0.125 ± -");
  EXPECT_EQ(mean_and_spread(2, 0.125, 0.25, 3), "0.125 ± 0.250");
}

TEST(WeakGrip, NamesConditionsOfEveryObject) {
  experiment::ModelComparison model;
  model.model = "sliding_pivot";
  const std::vector<std::tuple<const char*, const char*, bool>> thrown{
      {"bar", "fast", true}, {"box", "fast", true}, {"box", "slow", true}, {"can", "fast", false}};
  for (const auto& [object, condition, slips] : thrown)
    for (int repetition = 0; repetition < 2; ++repetition) {
      auto& one = model.throws.emplace_back();
      one.object = object, one.condition = condition;
      one.prediction.slips_at_start = slips;
    }
  testing::internal::CaptureStderr();
  tell_weak_grip(model);
  EXPECT_THAT(
      testing::internal::GetCapturedStderr(),
      testing::EndsWith("in 6 of 8 throws the grip cannot hold the object, which slips from the start; "
                        "conditions bar, fast; box, fast; slow\n"));
}

TEST(SmallEffect, IsNotCalledSmallWhereHeldOutErrorsFall) {
  fitting::SmallEffect small{
      "contact.viscous", {{"1/v_0", "s/m", 0.25, 0.01}}, -369, 8e-4, 0.1, {{1.23e-3, 0.911e-3}, {}}, false};
  EXPECT_THAT(small_text(small),
              testing::AllOf(testing::StartsWith("evident on the train throws, but the test throws do not"),
                             testing::EndsWith("and their likelihood does not rise enough)")));
  small.likelier = true;
  EXPECT_THAT(small_text(small), testing::EndsWith("and another of their errors grows)"));
  small.rms.position.after = 1.2e-3;
  EXPECT_THAT(small_text(small),
              testing::StartsWith(
                  "evident, but too small to matter: contact.viscous (1/v_0 = 0.250 ± 0.010 s/m; BIC"));
  small.rms.position.after = 1.83e-3;
  EXPECT_THAT(small_text(small), testing::HasSubstr("predictions of the test throws are worse with it"));
  small.likelier = false;
  EXPECT_THAT(small_text(small), testing::StartsWith("evident on the train throws alone"));
  small.any_pads = true;
  EXPECT_THAT(small_text(small), testing::StartsWith("evident, but no pads are without it: "));
}

TEST(FilterText, NamesTheFilterThatDelaysAsMuch) {
  fitting::AcceptedEffect late;
  late.id = "sensor.ft_time_offset";
  late.parameters = {{"offset", "s", 0.796e-3, 2e-5}};
  EXPECT_THAT(filter_text({late}), testing::HasSubstr("0.796 ms (200 Hz)"));
  fitting::AcceptedEffect tracker = late;
  tracker.id = "sensor.mocap_time_offset";
  EXPECT_THAT(filter_text({tracker}), testing::HasSubstr("of the tracker with a time constant of 0.796 ms"));
  EXPECT_THAT(filter_text({late, tracker}), testing::HasSubstr("data sheet"));
  late.parameters.front().value = -1e-3;  // no filter is early
  EXPECT_EQ(filter_text({late}), "");
  EXPECT_EQ(filter_text({}), "");
}

TEST(Separating, OnlyWhatSeparatesIsAdvised) {
  fitting::AcceptedEffect effect;
  effect.separating = {{"flight.wind", "throw faster", 0.999, 0.5, true},
                       {"flight.wind", "throw slower", 0.999, 0.99, false},
                       {"flight.lift", "add a sensor", 0.999, 0.991, false},
                       {"flight.lift", "throw slower", 0.999, 0.995, false}};
  EXPECT_THAT(
      separating_lines(effect),
      ElementsAre(HasSubstr("to tell it from flight.wind: throw faster"),
                  HasSubstr("none of the experiments tried tells it from flight.lift; the best is add")));
}

}  // namespace
}  // namespace unhand::apps
