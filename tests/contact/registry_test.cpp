// The contact models by name, and one that a program registers.
#include "contact/registry.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <string>
#include <utility>

#include "contact/gripper_delay.hpp"
#include "contact/limit_surface.hpp"
#include "tests/support/refusal.hpp"

namespace unhand::contact {
namespace {

using dynamics::Dual;
using testing::Contains;
using testing::HasSubstr;

/// A law by another name, which notes the values of its own parameter.
ContactModelEntry named(std::string name, std::vector<LawParameter> own,
                        std::vector<double>* seen = nullptr) {
  return {std::move(name),
          [seen](const ContactParameters<Dual>& p) -> std::unique_ptr<ContactModel> {
            for (const auto& [key, value] : p.law_values)
              if (seen) seen->push_back(value.a);
            return std::make_unique<SlidingPivot>(p.patch);
          },
          std::move(own)};
}

/// Registers a law once: its name is taken for good, and a test may run again.
void register_once(ContactModelEntry entry) {
  static std::set<std::string> done;
  if (done.insert(entry.name).second) register_contact_model(std::move(entry));
}

LawParameter glue() { return {"glue", "N", 1, 0, 10, 0.1, 9, 0.5, 2.0, ""}; }

TEST(Registry, TakesALawOfOnesOwn) {
  static std::vector<double> seen;  // by the law, which outlives the test
  seen.clear();
  register_once(named("glued", {glue()}, &seen));
  EXPECT_THAT(contact_model_names(), Contains("glued"));
  EXPECT_EQ(contact_model_names().front(), "sliding_pivot");
  ASSERT_EQ(law_parameters("glued").size(), 1u);
  EXPECT_EQ(law_parameters("glued")[0].unit, "N");
  ContactParameters<double> p;
  p.patch = {0.5, 0.01};
  p.law_values["glue"] = 2.5;
  EXPECT_EQ(make_contact_model("glued", p)->mode_count(), 10);
  EXPECT_THAT(seen, testing::ElementsAre(2.5));
  p.law_values.clear();
  make_contact_model("glued", p);
  EXPECT_THAT(seen, testing::ElementsAre(2.5, 1)) << "its start, where nobody says";
  EXPECT_TRUE(law_parameters("sliding_pivot").empty());
  EXPECT_TRUE(law_parameters("nobody").empty());
}

TEST(Registry, SaysWhichLawsFollowThePads) {
  EXPECT_FALSE(follows_pads(kGripperDelay));
  for (const char* law : {"sliding_pivot", "limit_surface", "limit_surface_disc", "limit_surface_quartic"})
    EXPECT_TRUE(follows_pads(law)) << law;
  auto rigid = named("rigid", {});
  rigid.follows_pads = false;
  register_once(std::move(rigid));
  EXPECT_FALSE(follows_pads("rigid"));
  EXPECT_THAT(pad_law_names(), testing::IsSupersetOf({"sliding_pivot", "limit_surface_disc"}));
  for (const char* other : {"rigid", kGripperDelay})
    EXPECT_THAT(pad_law_names(), testing::Not(Contains(other)));
}

TEST(Registry, GivenParametersAreTheLawsOwn) {
  register_once(named("pasted", {glue()}));
  const auto given = given_law_parameters("pasted", {{"glue", 3.0}, {"kappa", 1.0}});
  ASSERT_EQ(given.size(), 1u);
  EXPECT_EQ(given[0].parameter.name, "glue");
  EXPECT_EQ(given[0].value, 3.0);
  EXPECT_TRUE(given_law_parameters("pasted", {}).empty());
}

TEST(Registry, RefusesParametersThatALawDoesNotHave) {
  register_once(named("taped", {glue()}));
  const auto refusal = [](const char* law, LawValues<double> values) {
    ContactParameters<double> p;
    p.patch = {0.5, 0.01};
    p.law_values = std::move(values);
    return support::refusal([&] { make_contact_model(law, p); });
  };
  EXPECT_THAT(refusal("limit_surface_quartic", {{"kapa", 1}}), HasSubstr("no parameter \"kapa\""));
  EXPECT_THAT(refusal("limit_surface", {{"kappa", 1}}), HasSubstr("no parameter \"kappa\""));
  for (const double value : {-1.0, 11.0, std::nan("")})
    EXPECT_THAT(refusal("taped", {{"glue", value}}), HasSubstr("is not in [0, 10] N"));
  EXPECT_EQ(refusal("taped", {{"glue", 10}}), "accepted");
  EXPECT_THAT(refusal("limit_surface_quartic", {{"kappa", 9}}), testing::EndsWith("is not in [0, 3]"))
      << "no unit";
}

// A release at t = 0 would be the answer to another question.
TEST(Registry, ADelayThatNobodyGaveIsNotZero) {
  ContactParameters<double> p;
  const auto refusal = [&] { return support::refusal([&] { make_contact_model(kGripperDelay, p); }); };
  EXPECT_EQ(refusal(),
            "contact model \"gripper_delay\" needs open_command [s], when the gripper is told to open: it "
            "is not given");
  p.open_command = 0;
  EXPECT_THAT(refusal(), HasSubstr("needs delay [s], from the command to the release: it is not given"));
  p.delay = 0;
  EXPECT_EQ(refusal(), "accepted");
  for (const auto& name : contact_model_names()) EXPECT_NO_THROW(can_give(name)) << name;
}

TEST(Registry, GaugesAreOneOnTheSurface) {
  const auto gauge = [](const char* law, std::size_t k, Vec3<double> w) {
    return wrench_gauges(law).at(k)({Dual(w[0]), Dual(w[1]), Dual(w[2])}).a;
  };
  for (const char* law : {"limit_surface", "limit_surface_disc", "limit_surface_quartic", "gripper_delay",
                          "nobody", "sliding_pivot"})
    for (std::size_t k = 0; k < wrench_gauges(law).size(); ++k) {
      EXPECT_NEAR(gauge(law, k, {0.6, -0.8, 0}), 1, 1e-12) << law;  // pure slide
      EXPECT_NEAR(gauge(law, k, {0, 0, 2}), 2, 1e-12) << law;       // twice a pure spin
    }
  EXPECT_NEAR(gauge("limit_surface", 0, {0.6, 0, 0.8}), 1, 1e-12);
  EXPECT_NEAR(gauge("sliding_pivot", 1, {0.6, 0, 0.8}), 0.8, 1e-12);
}

TEST(Registry, RefusesWhatIsNoLaw) {
  const auto refusal = [](const ContactModelEntry& entry) {
    return support::refusal([&] { register_contact_model(entry); });
  };
  for (const char* name : {"", "two words", "line\nbreak", "quote\"", "comma,", "ümlaut"})
    EXPECT_THAT(refusal(named(name, {})), HasSubstr("not a valid name")) << name;
  for (const char* name :
       {"limit_surface_naive", "projectile", "free_fall", "ellipsoid", "ellipsoid_full", "convex_quartic"})
    EXPECT_THAT(refusal(named(name, {})), HasSubstr("no contact law")) << name;
  EXPECT_THAT(refusal(named(kGripperDelay, {})), HasSubstr("is taken"));
  EXPECT_THAT(refusal({"unmade", {}, {}}), HasSubstr("no maker"));
  const auto with = [&](auto change) {
    LawParameter p = glue();
    change(p);
    return refusal(named("refused", {p}));
  };
  EXPECT_THAT(with([](auto& p) { p.name = "mu"; }), HasSubstr("\"mu\""));
  EXPECT_THAT(with([](auto& p) { p.name = "contact.viscous"; }), HasSubstr("contact.viscous"));
  EXPECT_THAT(with([](auto& p) { p.unit = ""; }), HasSubstr("\"glue\" without a unit"));
  EXPECT_THAT(with([](auto& p) { p.start = 20; }), HasSubstr("\"glue\" = 20"));
  EXPECT_THAT(with([](auto& p) { p.start = NAN; }), HasSubstr("\"glue\" = nan"));
  EXPECT_THAT(with([](auto& p) { p.high = INFINITY; }), HasSubstr("inf"));
  EXPECT_THAT(with([](auto& p) { p.typical = 0; }), HasSubstr("a step of 0"));
  EXPECT_THAT(with([](auto& p) { p.prior_sigma = -1; }), HasSubstr("sigma of -1"));
  EXPECT_THAT(refusal(named("refused", {glue(), glue()})), HasSubstr("two parameters"));
  EXPECT_THAT(contact_model_names(), testing::Not(Contains("refused")));
}

TEST(Registry, AMakerThatGivesNothingIsNamed) {
  register_once({"hollow", [](const ContactParameters<Dual>&) { return nullptr; }, {}});
  ContactParameters<double> p;
  p.patch = {0.5, 0.01};
  EXPECT_THAT(support::refusal<std::logic_error>([&] { make_contact_model("hollow", p); }),
              HasSubstr("\"hollow\""));
}

TEST(Registry, ALimitSurfaceKeepsItsName) {
  auto name = std::make_unique<std::string>("a name longer than any small string holds in itself");
  const LimitSurface<Ellipsoid> law(*name, Patch<double>{0.5, 0.01});
  *name = std::string(name->size(), 'Z');
  name.reset();
  EXPECT_EQ(law.name(), "a name longer than any small string holds in itself");
}

}  // namespace
}  // namespace unhand::contact
