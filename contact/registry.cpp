#include "contact/registry.hpp"

#include <fmt/core.h>
#include <fmt/ranges.h>

#include <stdexcept>

#include "contact/gripper_delay.hpp"
#include "contact/limit_surface.hpp"

namespace unhand::contact {
namespace {

using Maker = std::unique_ptr<ContactModel> (*)(const ContactParameters<Dual>&);

/// A contact model is one line here.
constexpr std::pair<std::string_view, Maker> kModels[] = {
    {"sliding_pivot",
     [](const ContactParameters<Dual>& p) -> std::unique_ptr<ContactModel> {
       return std::make_unique<SlidingPivot>(p.patch, p.slide_end, p.variation);
     }},
    {"limit_surface",
     [](const ContactParameters<Dual>& p) -> std::unique_ptr<ContactModel> {
       return std::make_unique<LimitSurface<Ellipsoid>>("limit_surface", p.patch, Ellipsoid{}, p.variation);
     }},
    {"limit_surface_disc",
     [](const ContactParameters<Dual>& p) -> std::unique_ptr<ContactModel> {
       const Dual& exponent = p.variation.pressure_exponent;
       if (!dynamics::is_zero(exponent))
         return std::make_unique<LimitSurface<PressedDisc>>("limit_surface_disc", p.patch,
                                                            PressedDisc(exponent), p.variation);
       return std::make_unique<LimitSurface<UniformDisc>>("limit_surface_disc", p.patch, UniformDisc{},
                                                          p.variation);
     }},
    {"limit_surface_quartic",
     [](const ContactParameters<Dual>& p) -> std::unique_ptr<ContactModel> {
       const auto shape = p.kappa ? IsotropicQuartic(*p.kappa) : IsotropicQuartic::closest_to_disc();
       return std::make_unique<LimitSurface<IsotropicQuartic>>("limit_surface_quartic", p.patch, shape,
                                                               p.variation);
     }},
    {kGripperDelay,
     [](const ContactParameters<Dual>& p) -> std::unique_ptr<ContactModel> {
       return std::make_unique<GripperDelay>(p.open_command, p.delay);
     }},
};

}  // namespace

std::vector<std::string> contact_model_names() {
  std::vector<std::string> names;
  for (const auto& [name, maker] : kModels) names.emplace_back(name);
  return names;
}

std::unique_ptr<ContactModel> make_contact_model(std::string_view name,
                                                 const ContactParameters<Dual>& parameters) {
  for (const auto& [known, maker] : kModels)
    if (known == name) return maker(parameters);
  throw std::invalid_argument(fmt::format("contact model \"{}\" is unknown; there are {}", name,
                                          fmt::join(contact_model_names(), ", ")));
}

std::unique_ptr<ContactModel> make_contact_model(std::string_view name, const ContactParameters<double>& p) {
  return make_contact_model(
      name, ContactParameters<Dual>{constant(p.patch), p.slide_end,
                                    p.kappa ? std::optional<Dual>(*p.kappa) : std::nullopt, p.open_command,
                                    Dual(p.delay), constant(p.variation)});
}

}  // namespace unhand::contact
